// SPDX-License-Identifier: Apache-2.0
#include "image_files/stored_image.h"

#include <algorithm>
#include <span>
#include <utility>

#include "base/error.h"
#include "image_files/image_formats.h"

namespace af {

namespace fs = std::filesystem;

namespace {

using namespace image_formats;

/// Deflate cannot expand a byte to more than this many.
constexpr std::uint64_t kMaxDeflateRatio = 1040;

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

void reverse_each(std::vector<std::byte>& bytes, std::size_t value_bytes) {
  for (auto at = bytes.begin(); at != bytes.end();) {
    const auto end = at + static_cast<std::ptrdiff_t>(value_bytes);
    std::reverse(at, end);
    at = end;
  }
}

/// Values by slope and intercept, in double precision and then rounded to To, as ITK does.
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
  PayloadPieces pieces(header.skip_bytes, payload, visit);
  const ByteVisitor take = [&](std::span<const std::byte> bytes) { pieces.add(bytes); };
  std::uint64_t found = stored;
  if (header.compressed) {
    const InflatedBytes bytes = inflate_file(header.data_file, header.payload_offset, take);
    check_compressed_bytes(path, header, bytes.compressed, stored, warnings);
    found = bytes.inflated;
  } else if (stored >= expected) {
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

RawImage image_description(const ImageHeader& header) {
  RawImage image;
  image.size.assign(header.size.begin(), header.size.end());
  image.spacing_mm = header.spacing_mm;
  image.origin_mm = header.origin_mm;
  image.directions = header.directions;
  image.channels = header.channels;
  image.type = header.value_type;
  if (header.is_rescaled)
    image.type = header.value_type == ValueType::Float64 ? ValueType::Float64 : ValueType::Float32;
  return image;
}

void read_described_values(const fs::path& path,
                           const ImageHeader& header,
                           const RawImage& description,
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
    else if (description.type == ValueType::Float64)
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
  RawImage image = image_description(header);
  accept(image);
  read_described_values(path, header, image, warnings, [&](std::span<const std::byte> piece) {
    if (image.values.empty())
      image.values.reserve(image.voxel_count() * static_cast<std::size_t>(image.channels) *
                           value_bytes(image.type));
    image.values.insert(image.values.end(), piece.begin(), piece.end());
  });
  return image;
}

}  // namespace af
