// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "images/raw_image.h"

namespace af {

/// Image files that the project reads, told apart by content, not by name.
enum class ImageFormat { MetaImage, Nifti, Nrrd, Png, Tiff, Dicom };

std::string_view format_name(ImageFormat format);

/// The format of a file by its first bytes; nullopt for an unknown one. Throws FileError when it
/// cannot be read.
std::optional<ImageFormat> sniff_image_format(const std::filesystem::path& path);

/// What an unsupported file looks like, whatever its name, for messages: " (it begins as a JPEG
/// picture does)". Empty when that is unknown.
std::string foreign_content(const std::filesystem::path& path);

/// Deviation of axes from orthonormal that is allowed: the cosine between two of them, or the error
/// of a length. Cosines of three decimals leave this much. A grid within it is taken as the nearest
/// orthonormal one.
inline constexpr double kMaxDirectionError = 1e-3;

/// What can be told of an image file before a library is trusted with it.
struct ImageHeader {
  ImageFormat format = ImageFormat::MetaImage;
  /// The image without values, of the type as which they are read. Empty for PNG, TIFF and DICOM.
  RawImage image;
  std::uint64_t payload_offset = 0;  ///< where the (compressed) voxels begin
  std::uint64_t skip_bytes = 0;      ///< in front of the voxels, after decompression
  bool compressed = false;
  /// Bytes of the compressed stream, where the header states them.
  std::optional<std::uint64_t> compressed_bytes;
  std::filesystem::path data_file;  ///< the file that holds the voxels
  /// Type of one channel, as stored. This and what follows is known only for MetaImage, NRRD and
  /// NIfTI.
  ValueType value_type = ValueType::Int16;
  bool is_byte_swapped = false;  ///< in the opposite order to this machine's
  bool is_rescaled = false;      ///< values are stored * slope + intercept
  double slope = 1.0;
  double intercept = 0.0;
  bool has_orientation = true;
  bool has_spacing = true;
  std::vector<std::string> warnings;

  /// Bytes of one voxel with all its channels, as stored.
  [[nodiscard]] std::size_t voxel_bytes() const {
    return value_bytes(value_type) * static_cast<std::size_t>(image.channels);
  }
};

/// Reads and checks the header of a MetaImage, NRRD or NIfTI-1 file, and allocates nothing by what
/// it says. Throws FileError when it is damaged, its extents overflow or its encoding is not
/// supported, InputError for wrong units or spacing.
ImageHeader read_image_header(const std::filesystem::path& path, ImageFormat format);

}  // namespace af
