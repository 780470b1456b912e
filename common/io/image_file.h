// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "image/image2d.h"

namespace af {

/// Reads a 2-D image of any ITK format (mha, nii.gz, nrrd, tif, png 8/16-bit, single-slice DICOM)
/// as float, row 0 on top, values as stored (a DICOM file's own rescale is applied). FileError when
/// it cannot be parsed or is truncated; InputError when it is not 2-D or has several channels.
Image2d read_image(const std::filesystem::path& path);

/// Writes float pixels unscaled: .mha .nii.gz .nrrd .tif, atomically. Pixel spacing (mm) is written
/// where the format has it.
/// `.png` is refused here with a pointer to write_png_image().
void write_image(const Image2d& image,
                 const std::filesystem::path& path,
                 double column_spacing_mm,
                 double row_spacing_mm);

/// Several images of one size as one 3-D stack; same formats.
void write_image_stack(const std::vector<Image2d>& images,
                       const std::filesystem::path& path,
                       double column_spacing_mm,
                       double row_spacing_mm);

/// 16-bit unsigned MetaImage or PNG, for 12-bit X-rays.
void write_image_u16(const Image2d& image,
                     const std::filesystem::path& path,
                     double column_spacing_mm,
                     double row_spacing_mm);

/// 8-bit grey PNG, `low` black, `high` white, row 0 on top.
void write_png_image(const Image2d& image,
                     const std::filesystem::path& path,
                     double low,
                     double high);

}  // namespace af
