// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "image_files/image_header.h"

namespace af {

/// An image as it is stored: axes in file order (the first is fastest), LPS mm, values in their
/// own type.
struct RawImage {
  std::vector<std::size_t> size;
  std::vector<double> spacing_mm;
  std::vector<double> origin_mm;
  std::vector<std::vector<double>> directions;  ///< one vector per axis
  int channels = 1;
  ValueType type = ValueType::Int16;
  std::vector<std::byte> values;
  std::string note;  ///< what was done to the values; mostly nothing

  [[nodiscard]] std::size_t voxel_count() const;
};

std::size_t value_bytes(ValueType type);

/// Calls `function` with values of a type as a span of it.
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

template <typename Function>
decltype(auto) visit_values(const RawImage& image, Function&& function) {
  return visit_values(image.type, image.values, std::forward<Function>(function));
}

/// Throws when the reader does not want the image; sees it without values.
using AcceptImage = std::function<void(const RawImage&)>;

/// Reads an image file (not DICOM) by ITK. `accept` sees it before anything is allocated by the
/// header's sizes. FileError when ITK fails.
RawImage read_raw_image(const std::filesystem::path& path,
                        ImageFormat format,
                        const AcceptImage& accept);

/// Writes an image by ITK; the format follows the extension: .mha .nii .nii.gz .nrrd .tif .tiff
/// .png. Appears under its name only when complete. UsageError for another extension.
void write_raw_image(const RawImage& image, const std::filesystem::path& path);

}  // namespace af
