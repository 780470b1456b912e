// SPDX-License-Identifier: Apache-2.0
// Internal to image_files: how the header of each format is read and checked (NAME_header.cpp).
#pragma once

#include <cstdint>
#include <filesystem>

#include "image_files/image_header.h"

namespace af::image_formats {

/// NIfTI-1's header.
inline constexpr std::size_t kNifti1HeaderBytes = 348;

ImageHeader read_meta_header(const std::filesystem::path& path);
ImageHeader read_nrrd_header(const std::filesystem::path& path);
ImageHeader read_nifti_header(const std::filesystem::path& path);

/// Walks the chunks of a PNG file with their checksums up to its end mark.
void check_png(const std::filesystem::path& path);

/// Bytes of the voxels that a header promises; FileError when the product overflows or is absurd.
std::uint64_t checked_payload_bytes(const std::filesystem::path& path, const ImageHeader& header);

/// Size of the file that holds the voxels; FileError, naming the header's file, when there is none.
std::uint64_t existing_file_size(const std::filesystem::path& header_path,
                                 const std::filesystem::path& data_file);

}  // namespace af::image_formats
