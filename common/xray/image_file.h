// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "xray/image2d.h"

namespace af {

/// Reads a 2-D image of any supported format (mha, nii.gz, nrrd, tif, png 8/16-bit, single-slice
/// DICOM) as float, row 0 on top. Values are as stored, except that a DICOM file's own rescale is
/// applied and a TIFF file whose zero is white is inverted. Throws FileError when it cannot be
/// parsed or is truncated, InputError when it is not 2-D, has several channels or has pixels that
/// are not finite.
Image2d read_image(const std::filesystem::path& path);

/// Throws InputError that names the first pixel that is not finite, and `path`.
void check_is_finite(const Image2d& image, const std::filesystem::path& path);

/// An image with what its file says of its pixels.
struct ImageWithSpacing {
  Image2d image;
  /// Column, row. None for PNG, TIFF and DICOM, and for files that do not state it.
  std::optional<Eigen::Vector2d> spacing_mm;
  std::string note;  ///< what was done to the stored values; usually empty
};

/// read_image(), and the pixel spacing.
ImageWithSpacing read_image_with_spacing(const std::filesystem::path& path);

/// Reads a 3-D MetaImage, NRRD or NIfTI file as images of its first two axes, one after the other
/// along the third, with values as stored. Holds one image at a time. Errors are those of
/// read_image().
void for_each_image_of_stack(const std::filesystem::path& path,
                             const std::function<void(int number, Image2d&& image)>& visit);

/// Writes float pixels unscaled and atomically: .mha .nii.gz .nrrd .tif. Pixel spacing (mm) is
/// written where the format has it. `.png` is refused with a pointer to write_png_image().
void write_image(const Image2d& image,
                 const std::filesystem::path& path,
                 double column_spacing_mm,
                 double row_spacing_mm);

/// Where an image lies in space, LPS mm.
struct ImagePlane {
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();          ///< centre of pixel (0, 0)
  Eigen::Vector3d column_direction = Eigen::Vector3d::UnitX();  ///< unit, of increasing column
  Eigen::Vector3d row_direction = Eigen::Vector3d::UnitY();     ///< unit, of increasing row
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();         ///< column, row
};

/// Writes an image as a 3-D one of a single slice, 1 mm thick, where it lies in space: .mha .nii.gz
/// .nrrd.
void write_image_in_space(const Image2d& image,
                          const std::filesystem::path& path,
                          const ImagePlane& plane);

/// Writes several images of one size as one 3-D stack, in the same formats.
void write_image_stack(const std::vector<Image2d>& images,
                       const std::filesystem::path& path,
                       double column_spacing_mm,
                       double row_spacing_mm);

/// Writes 16-bit unsigned MetaImage or PNG, for 12-bit X-rays.
void write_image_u16(const Image2d& image,
                     const std::filesystem::path& path,
                     double column_spacing_mm,
                     double row_spacing_mm);

/// Writes 8-bit grey PNG: `low` is black, `high` white, row 0 on top.
void write_png_image(const Image2d& image,
                     const std::filesystem::path& path,
                     double low,
                     double high);

}  // namespace af
