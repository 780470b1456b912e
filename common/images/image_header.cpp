// SPDX-License-Identifier: Apache-2.0
#include "images/image_header.h"

#include <array>
#include <string_view>

#include "base/error.h"
#include "base/plausible.h"
#include "files/input_guard.h"
#include "images/file_bytes.h"
#include "images/image_formats.h"

namespace af {

namespace fs = std::filesystem;

namespace image_formats {

std::uint64_t checked_payload_bytes(const fs::path& path, const ImageHeader& header) {
  std::uint64_t voxels = 1;
  for (const std::uint64_t extent : header.image.size) {
    if (extent == 0 || voxels > kMaxVoxels / extent)
      throw FileError(path.string(),
                      "image size",
                      "at most " + std::to_string(kMaxVoxels) + " voxels",
                      "a header that says more");
    voxels *= extent;
  }
  return voxels * header.voxel_bytes();
}

std::uint64_t existing_file_size(const fs::path& header_path, const fs::path& data_file) {
  std::error_code error;
  const std::uint64_t bytes = fs::file_size(data_file, error);
  if (error)
    throw FileError(header_path.string(),
                    "its voxel file '" + data_file.string() + "': " + error.message());
  note_input(data_file);
  return bytes;
}

void set_default_place(ImageHeader& header) {
  const std::size_t axes = header.image.size.size();
  header.image.origin_mm.assign(axes, 0.0);
  header.image.directions.assign(axes, std::vector<double>(axes, 0.0));
  for (std::size_t axis = 0; axis < axes; ++axis) header.image.directions[axis][axis] = 1.0;
}

}  // namespace image_formats

namespace {

using namespace image_formats;

bool looks_like_nifti(std::string_view header) {
  if (header.size() >= kNifti1HeaderBytes) {
    const std::string_view magic = header.substr(344, 3);
    if (magic == "n+1" || magic == "ni1") return true;
  }
  return header.size() >= 7 && (header.substr(4, 3) == "n+2" || header.substr(4, 3) == "ni2");
}

bool looks_like_meta_image(std::string_view header) {
  // MetaIO accepts any order of keys; NDims stands in every header.
  const std::string_view start = header.substr(0, 1024);
  return start.find("NDims") != std::string_view::npos &&
         (start.starts_with("ObjectType") || start.starts_with("NDims") ||
          start.starts_with("Comment"));
}

}  // namespace

std::string_view format_name(ImageFormat format) {
  constexpr std::array<std::string_view, 6> kNames = {
      "MetaImage", "NIfTI", "NRRD", "PNG", "TIFF", "DICOM"};
  return kNames.at(static_cast<std::size_t>(format));
}

std::optional<ImageFormat> sniff_image_format(const fs::path& path) {
  const std::string start = read_prefix(path, 1024);
  const std::string_view bytes(start);
  // DICOM comes first, because its preamble may be the beginning of a TIFF file (PS3.10, 7.1).
  if (bytes.size() >= 132 && bytes.substr(128, 4) == "DICM") return ImageFormat::Dicom;
  if (bytes.starts_with("NRRD00")) return ImageFormat::Nrrd;
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return ImageFormat::Png;
  using namespace std::string_view_literals;
  for (const std::string_view tiff : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv})
    if (bytes.starts_with(tiff)) return ImageFormat::Tiff;
  if (looks_like_meta_image(bytes)) return ImageFormat::MetaImage;
  if (looks_like_nifti(bytes)) return ImageFormat::Nifti;
  if (is_gzip(bytes) && looks_like_nifti(read_inflated_prefix(path, kNifti1HeaderBytes)))
    return ImageFormat::Nifti;
  return std::nullopt;
}

std::string foreign_content(const fs::path& path) {
  using namespace std::string_view_literals;
  struct Content {
    std::string_view start;
    std::string_view what;
  };
  constexpr std::array<Content, 8> kKnown = {Content{"\xff\xd8\xff"sv, "a JPEG picture"},
                                             {"\0\0\0\x0cjP  "sv, "a JPEG 2000 picture"},
                                             {"\xff\x4f\xff\x51"sv, "a JPEG 2000 code stream"},
                                             {"GIF8"sv, "a GIF picture"},
                                             {"BM"sv, "a BMP picture"},
                                             {"PK\x03\x04"sv, "a ZIP archive"},
                                             {"%PDF"sv, "a PDF document"},
                                             {"<"sv, "a page of HTML or XML"}};
  const std::string start = read_prefix(path, 16);
  if (start.empty()) return " (it is empty)";
  for (const Content& content : kKnown)
    if (start.starts_with(content.start))
      return " (it begins as " + std::string(content.what) + " does)";
  return is_gzip(start) ? " (it is compressed by gzip)" : "";
}

ImageHeader read_image_header(const fs::path& path, ImageFormat format) {
  ImageHeader header;
  switch (format) {
    case ImageFormat::MetaImage:
      header = read_meta_header(path);
      break;
    case ImageFormat::Nifti:
      header = read_nifti_header(path);
      break;
    case ImageFormat::Nrrd:
      header = read_nrrd_header(path);
      break;
    default:
      header.format = format;
      header.data_file = path;
      return header;
  }
  (void)checked_payload_bytes(path, header);
  header.image.type = header.value_type;
  if (header.is_rescaled && header.value_type != ValueType::Float64)
    header.image.type = ValueType::Float32;
  return header;
}

}  // namespace af
