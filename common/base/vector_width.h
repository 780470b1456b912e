// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>
#include <vector>

namespace af {

/// Vector width of the kernels in use. All widths give identical bits; only speed differs.
enum class VectorWidth : int { Bits128 = 128, Bits256 = 256, Bits512 = 512 };

/// Widths this processor can run, narrowest first.
std::vector<VectorWidth> supported_vector_widths();

/// The widest supported width, unless the environment variable AF_VECTOR_BITS (128, 256 or 512) or
/// force_vector_width() says otherwise. Throws InputError when the forced width is unknown or not
/// supported here.
VectorWidth active_vector_width();

/// For tests and benchmarks: overrides AF_VECTOR_BITS; nullopt ends the override.
void force_vector_width(std::optional<VectorWidth> width);

/// "128", "256" or "512".
std::string_view to_string(VectorWidth width);

/// Chooses the entry of a kernel's three variants that matches the active width.
template <typename Function>
Function select_kernel(Function bits_128, Function bits_256, Function bits_512) {
  switch (active_vector_width()) {
    case VectorWidth::Bits512:
      return bits_512;
    case VectorWidth::Bits256:
      return bits_256;
    case VectorWidth::Bits128:
      break;
  }
  return bits_128;
}

}  // namespace af
