// SPDX-License-Identifier: Apache-2.0
#include "image_files/stored_image.h"

#include <algorithm>
#include <span>

#include "base/error.h"

namespace af {

namespace fs = std::filesystem;

namespace {

bool is_described_by_us(const ImageHeader& header) {
  return !header.size.empty();
}

/// Both parsers must have understood the same file: one may take the first of two equal keys, the
/// other the last.
void check_is_as_described(const fs::path& path, const ImageHeader& header, const RawImage& image) {
  std::uint64_t promised = 1;
  for (const std::uint64_t extent : header.size) promised *= extent;
  if (image.voxel_count() != promised)
    throw FileError(path.string(),
                    "voxels",
                    std::to_string(promised) + " by its header",
                    std::to_string(image.voxel_count()) + " by ITK's reading of it");
  const std::uint64_t bytes =
      static_cast<std::uint64_t>(image.channels) * value_bytes(header.value_type);
  if (header.value_bytes != bytes)
    throw FileError(path.string(),
                    "bytes of a voxel",
                    std::to_string(header.value_bytes) + " by its header",
                    std::to_string(bytes) + " by ITK's reading of it");
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

RawImage read_image_description(const fs::path& path,
                                const ImageHeader& header,
                                const AcceptImage& accept) {
  RawImage image;
  try {
    image = read_raw_image_header(path, header.format);
  } catch (const FileError&) {
    check_image_payload(path, header, nullptr);  // says more of a damaged stream than ITK does
    throw;
  }
  accept(image);
  if (!is_described_by_us(header)) return image;
  check_is_as_described(path, header, image);
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
  if (!is_described_by_us(header)) {
    check_image_payload(path, header, warnings);
    return read_raw_image(path, header.format, accept);
  }
  RawImage image = read_image_description(path, header, accept);
  read_described_values(path, header, image, warnings, [&](std::span<const std::byte> piece) {
    if (image.values.empty())
      image.values.reserve(image.voxel_count() * static_cast<std::size_t>(image.channels) *
                           value_bytes(image.type));
    image.values.insert(image.values.end(), piece.begin(), piece.end());
  });
  return image;
}

}  // namespace af
