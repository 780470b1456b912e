// SPDX-License-Identifier: Apache-2.0
#include "base/vector_width.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <string>

#include "base/error.h"

namespace af {

namespace {

std::atomic<int> forced_bits{0};

VectorWidth width_from_environment(const char* text) {
  const std::string value(text);
  for (const VectorWidth width : supported_vector_widths())
    if (value == to_string(width)) return width;
  throw InputError(
      "AF_VECTOR_BITS", value, "must be 128, 256 or 512 and supported by this processor");
}

}  // namespace

std::vector<VectorWidth> supported_vector_widths() {
  std::vector<VectorWidth> widths{VectorWidth::Bits128};
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2");
  if (avx2) widths.push_back(VectorWidth::Bits256);
  if (avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512cd"))
    widths.push_back(VectorWidth::Bits512);
  return widths;
}

VectorWidth active_vector_width() {
  if (const int bits = forced_bits.load(std::memory_order_relaxed); bits != 0)
    return static_cast<VectorWidth>(bits);
  static const VectorWidth from_start = [] {
    if (const char* text = std::getenv("AF_VECTOR_BITS"); text != nullptr && *text != '\0')
      return width_from_environment(text);
    return supported_vector_widths().back();
  }();
  return from_start;
}

void force_vector_width(std::optional<VectorWidth> width) {
  if (width) {
    const auto supported = supported_vector_widths();
    check(std::find(supported.begin(), supported.end(), *width) != supported.end(),
          "forced vector width is not supported by this processor");
  }
  forced_bits.store(width ? static_cast<int>(*width) : 0, std::memory_order_relaxed);
}

std::string_view to_string(VectorWidth width) {
  switch (width) {
    case VectorWidth::Bits128:
      return "128";
    case VectorWidth::Bits256:
      return "256";
    case VectorWidth::Bits512:
      break;
  }
  return "512";
}

}  // namespace af
