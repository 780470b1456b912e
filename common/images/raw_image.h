// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace af {

enum class ValueType { Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Float32, Float64 };

/// An image as it is stored: axes in file order (the first is fastest), LPS mm, values in their own
/// type.
struct RawImage {
  std::vector<std::size_t> size;
  std::vector<double> spacing_mm;
  std::vector<double> origin_mm;
  std::vector<std::vector<double>> directions;  ///< one vector per axis
  int channels = 1;
  ValueType type = ValueType::Int16;
  std::vector<std::byte> values;
  std::string note;  ///< what was done to the values; usually empty

  [[nodiscard]] std::size_t voxel_count() const {
    return std::accumulate(size.begin(), size.end(), std::size_t{1}, std::multiplies<>());
  }
  /// How many axes there are without those of one voxel at the end, but no fewer than `least`.
  [[nodiscard]] std::size_t used_axes(std::size_t least) const {
    std::size_t used = size.size();
    while (used > least && size[used - 1] == 1) --used;
    return used;
  }
};

/// Calls `function` with the values as a span of their own type.
template <typename Function>
decltype(auto) visit_values(ValueType type,
                            std::span<const std::byte> values,
                            Function&& function) {
  const auto as = [&]<typename T>(T) {
    return function(
        std::span<const T>(reinterpret_cast<const T*>(values.data()), values.size() / sizeof(T)));
  };
  switch (type) {
    case ValueType::Int8:
      return as(std::int8_t{});
    case ValueType::UInt8:
      return as(std::uint8_t{});
    case ValueType::Int16:
      return as(std::int16_t{});
    case ValueType::UInt16:
      return as(std::uint16_t{});
    case ValueType::Int32:
      return as(std::int32_t{});
    case ValueType::UInt32:
      return as(std::uint32_t{});
    case ValueType::Int64:
      return as(std::int64_t{});
    case ValueType::UInt64:
      return as(std::uint64_t{});
    case ValueType::Float32:
      return as(float{});
    case ValueType::Float64:
      break;
  }
  return as(double{});
}

inline std::size_t value_bytes(ValueType type) {
  return visit_values(
      type, {}, [](const auto values) { return sizeof(typename decltype(values)::value_type); });
}

template <typename Function>
decltype(auto) visit_values(const RawImage& image, Function&& function) {
  return visit_values(image.type, image.values, std::forward<Function>(function));
}

/// Throws when the reader does not want the image, which has no values yet.
using AcceptImage = std::function<void(const RawImage&)>;

}  // namespace af
