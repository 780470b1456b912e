// SPDX-License-Identifier: Apache-2.0
// How the header of each format is read and checked (NAME_header.cpp). Internal to image_files.
#pragma once

#include <cstdint>
#include <filesystem>

#include "images/image_header.h"

namespace af::image_formats {

/// NIfTI-1's header.
inline constexpr std::size_t kNifti1HeaderBytes = 348;

ImageHeader read_meta_header(const std::filesystem::path& path);
ImageHeader read_nrrd_header(const std::filesystem::path& path);
ImageHeader read_nifti_header(const std::filesystem::path& path);

/// Sets the origin to 0 and the axes along the coordinates, where nothing is stated.
void set_default_place(ImageHeader& header);

/// Reads grey of 1 to 16 bits by libpng, with values as stored. ITK 5.2 changes them (it stretches
/// 1 to 4 bits, shifts by sBIT, adds alpha by tRNS), and ends the process on a damaged header.
RawImage read_png(const std::filesystem::path& path, const AcceptImage& accept);

/// Reads grey pages of integers or floats by libtiff, upright as the orientation tag says, with
/// WhiteIsZero inverted. Several pages are a stack; thumbnails and masks are left out. Throws
/// InputError for colour, palettes, alpha and unsupported number types. ITK 5.2 ignores all of this
/// except palettes, and leaves pixels of 32-bit integers uninitialised.
RawImage read_tiff(const std::filesystem::path& path, const AcceptImage& accept);

/// Bytes of the voxels that a header promises. Throws FileError when the product overflows or is
/// absurd.
std::uint64_t checked_payload_bytes(const std::filesystem::path& path, const ImageHeader& header);

/// Size of the file that holds the voxels. Throws FileError, naming the header's file, when there
/// is none.
std::uint64_t existing_file_size(const std::filesystem::path& header_path,
                                 const std::filesystem::path& data_file);

}  // namespace af::image_formats
