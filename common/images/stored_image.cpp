// SPDX-License-Identifier: Apache-2.0
#include "images/stored_image.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "base/error.h"
#include "files/captured_output.h"
#include "files/input_guard.h"
#include "files/output_file.h"
#include "images/file_bytes.h"
#include "images/image_formats.h"
#include "images/itk_image_io.h"

namespace af {

namespace fs = std::filesystem;

namespace {

using namespace image_formats;

/// Deflate cannot expand a byte to more than this many.
constexpr std::uint64_t kMaxDeflateRatio = 1040;
constexpr std::uint64_t kPieceBytes = std::uint64_t{1} << 20;

[[noreturn]] void fail_short(const ImageHeader& header,
                             std::uint64_t expected,
                             std::uint64_t found) {
  throw FileError(header.data_file.string(),
                  "truncated: voxel data",
                  std::to_string(expected) + " bytes",
                  std::to_string(found));
}

/// A stream of another length than stated is another stream, or was cut and mended. What follows it
/// gets a warning, and is not read.
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

void reverse_each(std::vector<std::byte>& bytes, std::size_t value_bytes) {
  for (auto at = bytes.begin(); at != bytes.end();) {
    const auto end = at + static_cast<std::ptrdiff_t>(value_bytes);
    std::reverse(at, end);
    at = end;
  }
}

/// Applies slope and intercept in double precision and rounds to To, as ITK does.
template <typename To>
std::vector<std::byte> rescaled_to(const ImageHeader& header, std::span<const std::byte> bytes) {
  std::vector<To> values;
  visit_values(header.value_type, bytes, [&](const auto stored) {
    values.reserve(stored.size());
    for (const auto value : stored)
      values.push_back(
          static_cast<To>(static_cast<double>(value) * header.slope + header.intercept));
  });
  const auto raw = std::as_bytes(std::span(values));
  return {raw.begin(), raw.end()};
}

struct WritableFormat {
  std::string_view extension;
  ImageFormat format;
};
constexpr std::array<WritableFormat, 7> kWritable = {{{".nii.gz", ImageFormat::Nifti},
                                                      {".nii", ImageFormat::Nifti},
                                                      {".mha", ImageFormat::MetaImage},
                                                      {".nrrd", ImageFormat::Nrrd},
                                                      {".tif", ImageFormat::Tiff},
                                                      {".tiff", ImageFormat::Tiff},
                                                      {".png", ImageFormat::Png}}};

WritableFormat writable_format(const fs::path& path) {
  const std::string name = path.filename().string();
  for (const WritableFormat& known : kWritable)
    if (name.size() > known.extension.size() && name.ends_with(known.extension)) return known;
  throw UsageError(path.string() +
                   ": unknown image extension; known: .mha .nii.gz .nii .nrrd .tif .tiff .png");
}

/// ITK does not notice a full disk: it leaves a shorter file without a word.
void check_is_whole(const RawImage& image, const fs::path& file, ImageFormat format) {
  bool is_whole = false;
  try {
    const ImageHeader header = read_image_header(file, format);
    const RawImage found = read_stored_image(file, header, nullptr, [](const RawImage&) {});
    is_whole = found.type == image.type && found.values == image.values;
  } catch (const FileError&) {
  }
  if (is_whole) return;
  std::error_code error;
  const fs::space_info space =
      fs::space(file.parent_path().empty() ? "." : file.parent_path(), error);
  throw FileError(file.string(),
                  "cannot be written whole: other voxels are read back" +
                      (error ? std::string()
                             : " (" + std::to_string(space.available) +
                                   " bytes are left on its disk; ulimit -f may set a limit, too)"));
}

}  // namespace

void read_image_payload(const fs::path& path,
                        const ImageHeader& header,
                        std::vector<std::string>* warnings,
                        const ByteVisitor& visit) {
  const std::uint64_t payload = checked_payload_bytes(path, header);
  const std::uint64_t expected = payload + header.skip_bytes;
  const std::uint64_t file_bytes = existing_file_size(path, header.data_file);
  const std::uint64_t stored =
      file_bytes > header.payload_offset ? file_bytes - header.payload_offset : 0;
  if (header.compressed && stored < expected / kMaxDeflateRatio)
    throw FileError(path.string(),
                    "truncated: " + std::to_string(stored) + " compressed bytes cannot hold the " +
                        std::to_string(expected) + " bytes that the header promises");
  if (!header.compressed && stored < expected) fail_short(header, expected, stored);
  ByteSource source(header.data_file, header.payload_offset, header.compressed);
  std::uint64_t found = 0;
  std::vector<std::byte> piece(kPieceBytes);
  for (std::uint64_t end : {header.skip_bytes, expected})
    while (found < end) {
      const std::span<std::byte> next =
          std::span(piece).first(std::min<std::uint64_t>(kPieceBytes, end - found));
      const std::size_t taken = source.read(next);
      found += taken;
      if (taken < next.size()) fail_short(header, expected, found);
      if (end == expected) visit(next);
    }
  const std::uint64_t surplus = source.drain();
  if (header.compressed)
    check_compressed_bytes(path, header, source.compressed_bytes(), stored, warnings);
  if (surplus > 0 && warnings != nullptr)
    warnings->push_back(header.data_file.string() + ": " + std::to_string(surplus) +
                        " bytes more than the header says; they are ignored");
}

void read_described_values(const fs::path& path,
                           const ImageHeader& header,
                           std::vector<std::string>* warnings,
                           const ByteVisitor& visit) {
  const std::size_t stored_bytes = value_bytes(header.value_type);
  std::vector<std::byte> copy;
  read_image_payload(path, header, warnings, [&](std::span<const std::byte> piece) {
    if (header.is_byte_swapped && stored_bytes > 1) {
      copy.assign(piece.begin(), piece.end());
      reverse_each(copy, stored_bytes);
      piece = copy;
    }
    if (!header.is_rescaled)
      visit(piece);
    else if (header.image.type == ValueType::Float64)
      visit(rescaled_to<double>(header, piece));
    else
      visit(rescaled_to<float>(header, piece));
  });
}

RawImage read_stored_image(const fs::path& path,
                           const ImageHeader& header,
                           std::vector<std::string>* warnings,
                           const AcceptImage& accept) {
  if (header.format == ImageFormat::Tiff) return read_tiff(path, accept);
  if (header.format == ImageFormat::Png) return read_png(path, accept);
  RawImage image = header.image;
  accept(image);
  read_described_values(path, header, warnings, [&](std::span<const std::byte> piece) {
    if (image.values.empty())
      image.values.reserve(image.voxel_count() * static_cast<std::size_t>(image.channels) *
                           value_bytes(image.type));
    image.values.insert(image.values.end(), piece.begin(), piece.end());
  });
  return image;
}

void write_raw_image(const RawImage& image, const fs::path& path) {
  const WritableFormat target = writable_format(path);
  if (target.format == ImageFormat::Png) {
    // ITK crashes when a PNG file cannot be written.
    write_text_file(path, captured_output(path.string(), [&](int descriptor) {
                      write_by_itk(
                          image, "/proc/self/fd/" + std::to_string(descriptor), target.format);
                    }));
    return;
  }
  write_atomically(path, [&](const fs::path& partial) {
    write_by_itk(image, partial, target.format);
    note_written(partial);
    check_is_whole(image, partial, target.format);
  });
}

}  // namespace af
