// SPDX-License-Identifier: Apache-2.0
#include "xray/image_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include "base/error.h"
#include "images/dicom_pixels.h"
#include "images/image_header.h"
#include "images/stored_image.h"

namespace af {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxPixels = std::size_t{1} << 28;  ///< 1 GB as float
/// Deflate and LZW cannot expand a byte to more than this many.
constexpr std::size_t kMaxExpansion = 4096;

/// Accepts grey images that fit into memory, on the first two axes.
void check_is_of_images(const RawImage& image, const fs::path& path) {
  if (image.channels != 1)
    throw InputError(
        "channels", std::to_string(image.channels), "must be grey (one channel)", path.string());
  if (image.size[0] == 0 || image.size[1] == 0 || image.size[0] > kMaxPixels / image.size[1])
    throw InputError("size",
                     std::to_string(image.size[0]) + " x " + std::to_string(image.size[1]),
                     "must be 1 to 2^28 pixels",
                     path.string());
}

void check_is_2d(const RawImage& image, const fs::path& path) {
  if (const std::size_t used = image.used_axes(2); used != 2)
    throw InputError("dimensions", std::to_string(used), "must be a 2-D image", path.string());
  check_is_of_images(image, path);
  // For other formats, the bytes are counted before memory is taken.
  const bool is_picture = image.directions.empty();
  const std::size_t bytes = image.voxel_count() * value_bytes(image.type);
  if (std::error_code error; is_picture && bytes / kMaxExpansion > fs::file_size(path, error))
    throw FileError(path.string(),
                    "truncated: the file is too small for its " + std::to_string(image.size[0]) +
                        " x " + std::to_string(image.size[1]) + " pixels");
}

void check_is_stack(const RawImage& image, const fs::path& path) {
  constexpr std::size_t kMostImages = 100000;
  if (image.size.size() != 3)
    throw InputError(
        "dimensions", std::to_string(image.size.size()), "must be a 3-D stack", path.string());
  check_is_of_images(image, path);
  if (image.size[2] > kMostImages)
    throw InputError("images", std::to_string(image.size[2]), "at most 100000", path.string());
}

RawImage raw_image_of(std::vector<std::size_t> size, ValueType type, double dx_mm, double dy_mm) {
  RawImage image;
  const std::size_t dimensions = size.size();
  image.size = std::move(size);
  image.type = type;
  image.spacing_mm = {dx_mm, dy_mm};
  image.spacing_mm.resize(dimensions, 1.0);
  image.origin_mm.assign(dimensions, 0.0);
  for (std::size_t axis = 0; axis < dimensions; ++axis) {
    image.directions.emplace_back(dimensions, 0.0);
    image.directions.back()[axis] = 1.0;
  }
  return image;
}

void append(std::vector<std::byte>& bytes, std::span<const float> values) {
  const auto raw = std::as_bytes(values);
  bytes.insert(bytes.end(), raw.begin(), raw.end());
}

void refuse_png(const fs::path& path) {
  if (path.extension() == ".png")
    throw UsageError(path.string() +
                     ": float pixels do not fit into PNG; use .mha, .nii.gz, .nrrd or .tif, or "
                     "write_png_image() for an 8-bit picture with a stated window");
}

void check_is_image(const Image2d& image) {
  check(image.width > 0 && image.height > 0 &&
            image.pixels.size() ==
                static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height),
        "an image to write has pixels for its size");
}

Image2d read_dicom_image(const fs::path& path) {
  const DicomPixelLayout layout = dicom_pixel_layout(DicomElements::read(path));
  const DicomPixels pixels = read_dicom_pixels(layout);
  if (pixels.padded > 0)
    throw InputError(layout.padding_text(),
                     std::to_string(pixels.padded) + " pixels",
                     "are padding, and here every pixel must have a value",
                     path.string());
  Image2d image(layout.columns, layout.rows);
  std::transform(
      pixels.values.begin(), pixels.values.end(), image.pixels.begin(), [](const double value) {
        return static_cast<float>(value);
      });
  check_is_finite(image, path);
  return image;
}

std::size_t extent(int value) {
  return static_cast<std::size_t>(value);
}

}  // namespace

void check_is_finite(const Image2d& image, const fs::path& path) {
  const auto found = std::find_if_not(
      image.pixels.begin(), image.pixels.end(), [](float value) { return std::isfinite(value); });
  if (found == image.pixels.end()) return;
  const auto at = static_cast<int>(found - image.pixels.begin());
  throw InputError(
      "pixel (" + std::to_string(at % image.width) + ", " + std::to_string(at / image.width) + ")",
      std::to_string(*found),
      "must be finite",
      path.string());
}

Image2d read_image(const fs::path& path) {
  return read_image_with_spacing(path).image;
}

ImageWithSpacing read_image_with_spacing(const fs::path& path) {
  const std::optional<ImageFormat> format = sniff_image_format(path);
  if (!format)
    throw FileError(
        path.string(),
        "not an image: its content is none of MetaImage, NIfTI, NRRD, TIFF, PNG, DICOM" +
            foreign_content(path));
  if (*format == ImageFormat::Dicom) return {read_dicom_image(path), std::nullopt, {}};
  const ImageHeader header = read_image_header(path, *format);
  const RawImage raw = read_stored_image(
      path, header, nullptr, [&](const RawImage& seen) { check_is_2d(seen, path); });
  Image2d image(static_cast<int>(raw.size[0]), static_cast<int>(raw.size[1]));
  visit_values(raw, [&](const auto values) {
    std::transform(values.begin(), values.end(), image.pixels.begin(), [](const auto value) {
      return static_cast<float>(value);
    });
  });
  check_is_finite(image, path);
  std::optional<Eigen::Vector2d> spacing_mm;
  if (*format != ImageFormat::Png && *format != ImageFormat::Tiff && header.has_spacing)
    spacing_mm = Eigen::Vector2d(raw.spacing_mm[0], raw.spacing_mm[1]);
  return {std::move(image), spacing_mm, raw.note};
}

void for_each_image_of_stack(const fs::path& path,
                             const std::function<void(int number, Image2d&& image)>& visit) {
  const std::optional<ImageFormat> format = sniff_image_format(path);
  if (!format) throw FileError(path.string(), "not a stack of images: its content is of no format");
  const bool has_values = *format == ImageFormat::MetaImage || *format == ImageFormat::Nrrd ||
                          *format == ImageFormat::Nifti;
  if (!has_values)
    throw InputError("stack",
                     std::string(format_name(*format)),
                     "must be MetaImage, NRRD or NIfTI; convert it, or give one file per image",
                     path.string());
  const ImageHeader header = read_image_header(path, *format);
  const RawImage& description = header.image;
  check_is_stack(description, path);
  const auto empty = [&] {
    return Image2d(static_cast<int>(description.size[0]), static_cast<int>(description.size[1]));
  };
  Image2d image = empty();
  std::size_t filled = 0;
  int number = 0;
  const auto add = [&](float value) {
    image.pixels[filled++] = value;
    if (filled < image.pixels.size()) return;
    check_is_finite(image, path);
    visit(number++, std::move(image));
    image = empty();
    filled = 0;
  };
  read_described_values(path, header, nullptr, [&](std::span<const std::byte> piece) {
    visit_values(description.type, piece, [&](const auto values) {
      for (const auto value : values) add(static_cast<float>(value));
    });
  });
}

void write_image(const Image2d& image,
                 const fs::path& path,
                 double column_spacing_mm,
                 double row_spacing_mm) {
  refuse_png(path);
  check_is_image(image);
  RawImage raw = raw_image_of({extent(image.width), extent(image.height)},
                              ValueType::Float32,
                              column_spacing_mm,
                              row_spacing_mm);
  append(raw.values, image.pixels);
  write_raw_image(raw, path);
}

void write_image_in_space(const Image2d& image, const fs::path& path, const ImagePlane& plane) {
  refuse_png(path);
  check_is_image(image);
  RawImage raw = raw_image_of({extent(image.width), extent(image.height), 1},
                              ValueType::Float32,
                              plane.spacing_mm.x(),
                              plane.spacing_mm.y());
  const auto values_of = [](const Eigen::Vector3d& vector) {
    return std::vector<double>(vector.begin(), vector.end());
  };
  raw.origin_mm = values_of(plane.origin_mm);
  raw.directions = {values_of(plane.column_direction),
                    values_of(plane.row_direction),
                    values_of(plane.column_direction.cross(plane.row_direction))};
  append(raw.values, image.pixels);
  write_raw_image(raw, path);
}

void write_image_stack(const std::vector<Image2d>& images,
                       const fs::path& path,
                       double column_spacing_mm,
                       double row_spacing_mm) {
  refuse_png(path);
  check(!images.empty(), "an image stack to write is not empty");
  RawImage raw = raw_image_of({extent(images[0].width), extent(images[0].height), images.size()},
                              ValueType::Float32,
                              column_spacing_mm,
                              row_spacing_mm);
  for (const Image2d& image : images) {
    check_is_image(image);
    check(image.width == images[0].width && image.height == images[0].height,
          "the images of a stack have one size");
    append(raw.values, image.pixels);
  }
  write_raw_image(raw, path);
}

void write_image_u16(const Image2d& image,
                     const fs::path& path,
                     double column_spacing_mm,
                     double row_spacing_mm) {
  check_is_image(image);
  RawImage raw = raw_image_of({extent(image.width), extent(image.height)},
                              ValueType::UInt16,
                              column_spacing_mm,
                              row_spacing_mm);
  std::vector<std::uint16_t> levels;
  levels.reserve(image.pixels.size());
  for (const float pixel : image.pixels)
    levels.push_back(static_cast<std::uint16_t>(std::nearbyint(std::clamp(pixel, 0.0f, 65535.0f))));
  const auto bytes = std::as_bytes(std::span<const std::uint16_t>(levels));
  raw.values.assign(bytes.begin(), bytes.end());
  write_raw_image(raw, path);
}

void write_png_image(const Image2d& image, const fs::path& path, double low, double high) {
  check_is_image(image);
  check(high > low, "a picture's white value is above its black value");
  if (path.extension() != ".png")
    throw UsageError(path.string() + ": an 8-bit picture is written as .png");
  RawImage raw =
      raw_image_of({extent(image.width), extent(image.height)}, ValueType::UInt8, 1.0, 1.0);
  raw.values.reserve(image.pixels.size());
  for (const float pixel : image.pixels) {
    const double share = (static_cast<double>(pixel) - low) / (high - low);
    // NaN fails the comparison and becomes black.
    const double level = share >= 0.0 ? std::min(share, 1.0) * 255.0 : 0.0;
    raw.values.push_back(static_cast<std::byte>(std::nearbyint(level)));
  }
  write_raw_image(raw, path);
}

}  // namespace af
