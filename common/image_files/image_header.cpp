// SPDX-License-Identifier: Apache-2.0
#include "image_files/image_header.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "files/input_guard.h"
#include "image_files/image_formats.h"
#include "image_files/stored_bytes.h"

namespace af {

namespace fs = std::filesystem;

namespace image_formats {

constexpr std::uint64_t kMaxVoxels = std::uint64_t{1} << 32;

std::uint64_t checked_payload_bytes(const fs::path& path, const ImageHeader& header) {
  std::uint64_t voxels = 1;
  for (const std::uint64_t extent : header.size) {
    if (extent == 0 || voxels > kMaxVoxels / extent)
      throw FileError(path.string(),
                      "image size",
                      "at most " + std::to_string(kMaxVoxels) + " voxels",
                      "a header that says more");
    voxels *= extent;
  }
  return voxels * header.value_bytes;
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

}  // namespace image_formats

namespace {

using namespace image_formats;

/// Deflate cannot expand a byte to more than this many.
constexpr std::uint64_t kMaxDeflateRatio = 1040;

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

/// Cuts a stream of bytes into pieces of kPieceBytes, without what stands before and after the
/// voxels.
class PayloadPieces {
 public:
  PayloadPieces(std::uint64_t skipped_bytes, std::uint64_t payload_bytes, ByteVisitor visit)
      : to_skip_(skipped_bytes), to_come_(payload_bytes), visit_(std::move(visit)) {}

  void add(std::span<const std::byte> bytes) {
    const auto skipped = std::min<std::uint64_t>(to_skip_, bytes.size());
    to_skip_ -= skipped;
    bytes = bytes.subspan(skipped);
    bytes = bytes.first(std::min<std::uint64_t>(to_come_, bytes.size()));
    to_come_ -= bytes.size();
    while (!bytes.empty()) {
      const std::size_t taken = std::min(bytes.size(), kPieceBytes - piece_.size());
      piece_.insert(
          piece_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(taken));
      bytes = bytes.subspan(taken);
      if (piece_.size() == kPieceBytes) flush();
    }
    if (to_come_ == 0) flush();
  }

 private:
  void flush() {
    if (!piece_.empty()) visit_(piece_);
    piece_.clear();
  }

  std::uint64_t to_skip_;
  std::uint64_t to_come_;
  ByteVisitor visit_;
  std::vector<std::byte> piece_;
};

/// A stream of another length than stated is another stream, or was cut and mended. What stands
/// behind it is said, not read.
void check_compressed_bytes(const fs::path& path,
                            const ImageHeader& header,
                            std::uint64_t found,
                            std::uint64_t stored,
                            std::vector<std::string>* warnings) {
  if (header.compressed_bytes.value_or(found) != found)
    throw FileError(path.string(),
                    "CompressedDataSize",
                    std::to_string(found) + ", the length of the compressed voxels",
                    std::to_string(*header.compressed_bytes));
  if (found < stored && warnings != nullptr)
    warnings->push_back(header.data_file.string() + ": " + std::to_string(stored - found) +
                        " bytes behind the compressed voxels are ignored");
}

}  // namespace

std::string_view format_name(ImageFormat format) {
  switch (format) {
    case ImageFormat::MetaImage:
      return "MetaImage";
    case ImageFormat::Nifti:
      return "NIfTI";
    case ImageFormat::Nrrd:
      return "NRRD";
    case ImageFormat::Png:
      return "PNG";
    case ImageFormat::Tiff:
      return "TIFF";
    case ImageFormat::Dicom:
      return "DICOM";
  }
  return "unknown";
}

std::optional<ImageFormat> sniff_image_format(const fs::path& path) {
  const std::string start = read_prefix(path, 1024);
  const std::string_view bytes(start);
  if (bytes.starts_with("NRRD00")) return ImageFormat::Nrrd;
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return ImageFormat::Png;
  using namespace std::string_view_literals;
  if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv)) return ImageFormat::Tiff;
  if (bytes.size() >= 132 && bytes.substr(128, 4) == "DICM") return ImageFormat::Dicom;
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
  return header;
}

void check_image_payload(const fs::path& path,
                         const ImageHeader& header,
                         std::vector<std::string>* warnings) {
  read_image_payload(path, header, warnings, nullptr);
}

void read_image_payload(const fs::path& path,
                        const ImageHeader& header,
                        std::vector<std::string>* warnings,
                        const ByteVisitor& visit) {
  if (header.format == ImageFormat::Png) check_png(path);
  if (header.size.empty()) return;
  const std::uint64_t payload = checked_payload_bytes(path, header);
  const std::uint64_t expected = payload + header.skip_bytes;
  const std::uint64_t file_bytes = existing_file_size(path, header.data_file);
  const std::uint64_t stored =
      file_bytes > header.payload_offset ? file_bytes - header.payload_offset : 0;
  if (header.compressed && stored < expected / kMaxDeflateRatio)
    throw FileError(path.string(),
                    "truncated: " + std::to_string(stored) + " compressed bytes cannot hold the " +
                        std::to_string(expected) + " bytes that the header promises");
  PayloadPieces pieces(header.skip_bytes, payload, visit);
  const ByteVisitor take = [&](std::span<const std::byte> bytes) {
    if (visit) pieces.add(bytes);
  };
  std::uint64_t found = stored;
  if (header.compressed) {
    const InflatedBytes bytes = inflate_file(header.data_file, header.payload_offset, take);
    check_compressed_bytes(path, header, bytes.compressed, stored, warnings);
    found = bytes.inflated;
  } else if (visit && stored >= expected) {
    found = read_plain_file(header.data_file, header.payload_offset, take);
  }
  if (found < expected)
    throw FileError(header.data_file.string(),
                    "truncated: voxel data",
                    std::to_string(expected) + " bytes",
                    std::to_string(found));
  if (found > expected && warnings != nullptr)
    warnings->push_back(header.data_file.string() + ": " + std::to_string(found - expected) +
                        " bytes more than the header says; they are ignored");
}

}  // namespace af
