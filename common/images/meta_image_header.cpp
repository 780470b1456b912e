// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "images/file_bytes.h"
#include "images/image_formats.h"
#include "images/image_text_header.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

TextHeader parse_meta_text(const fs::path& path) {
  const std::string bytes = read_prefix(path, kMaxTextHeaderBytes);
  std::istringstream text(bytes);
  TextHeader header{path.string(), {}, 0};
  for (std::string line; std::getline(text, line);) {
    // A header file may end without a newline after its last line.
    const bool is_cut = bytes.size() == kMaxTextHeaderBytes || line.find('\0') != std::string::npos;
    if (text.eof() && is_cut) break;
    const auto separator = line.find_first_of("=:");
    if (separator == std::string::npos && trimmed(line).empty()) continue;
    if (separator == std::string::npos) break;
    const std::string key = trimmed(line.substr(0, separator));
    header.add(key, trimmed(line.substr(separator + 1)));
    if (key != "ElementDataFile") continue;
    header.end_offset = text.eof() ? bytes.size() : static_cast<std::uint64_t>(text.tellg());
    return header;
  }
  throw FileError(path.string(), "MetaImage header ends without ElementDataFile");
}

ValueType meta_value_type(const TextHeader& header) {
  static const std::map<std::string, ValueType> type_of_name = {
      {"MET_CHAR", ValueType::Int8},
      {"MET_UCHAR", ValueType::UInt8},
      {"MET_SHORT", ValueType::Int16},
      {"MET_USHORT", ValueType::UInt16},
      {"MET_INT", ValueType::Int32},
      {"MET_UINT", ValueType::UInt32},
      {"MET_LONG", ValueType::Int32},  // 4 bytes in MetaImage files
      {"MET_ULONG", ValueType::UInt32},
      {"MET_LONG_LONG", ValueType::Int64},
      {"MET_ULONG_LONG", ValueType::UInt64},
      {"MET_FLOAT", ValueType::Float32},
      {"MET_DOUBLE", ValueType::Float64}};
  const std::string& type = header.require("ElementType");
  const auto found = type_of_name.find(type);
  if (found == type_of_name.end())
    throw FileError(header.path, "ElementType", "one of MET_CHAR ... MET_DOUBLE", type);
  return found->second;
}

bool is_true(const TextHeader& header, const std::string& key, bool fallback) {
  const std::string* value = header.find(key);
  if (value == nullptr || value->empty()) return fallback;
  return (*value)[0] == 'T' || (*value)[0] == 't' || (*value)[0] == '1';
}

/// The numbers of the first of some keys that the header has; none when it has none of them. Throws
/// FileError when they are not `expected` numbers, or another of the keys has others.
std::vector<double> meta_numbers(const TextHeader& header,
                                 std::initializer_list<const char*> keys,
                                 std::size_t expected) {
  std::vector<double> found;
  for (const std::string key : keys) {
    const std::string* text = header.find(key);
    if (text == nullptr) continue;
    const std::vector<double> numbers = header.numbers(key);
    if (!std::ranges::all_of(numbers, [](double value) { return std::isfinite(value); }))
      throw InputError(key, "'" + *text + "'", "must be finite", header.path);
    if (numbers.size() != expected)
      throw FileError(header.path, key, std::to_string(expected) + " numbers", "'" + *text + "'");
    if (found.empty())
      found = numbers;
    else if (found != numbers)
      throw FileError(header.path, key + " contradicts another key of the same meaning");
  }
  return found;
}

/// Where the image lies. MetaIO stores one axis direction after the other.
void read_meta_place(const TextHeader& text, ImageHeader& header) {
  const std::size_t axes = header.image.size.size();
  set_default_place(header);
  if (const auto origin = meta_numbers(text, {"Offset", "Position", "Origin"}, axes);
      !origin.empty())
    header.image.origin_mm = origin;
  const auto matrix =
      meta_numbers(text, {"TransformMatrix", "Rotation", "Orientation"}, axes * axes);
  header.has_orientation = !matrix.empty();
  for (std::size_t i = 0; i < matrix.size(); ++i)
    header.image.directions[i / axes][i % axes] = matrix[i];
  header.image.spacing_mm = meta_numbers(text, {"ElementSpacing"}, axes);
  if (header.image.spacing_mm.empty())
    header.image.spacing_mm = meta_numbers(text, {"ElementSize"}, axes);
  header.has_spacing = !header.image.spacing_mm.empty();
  header.image.spacing_mm.resize(axes, 1.0);
  const std::string* const unit = text.find("DistanceUnits");
  if (unit != nullptr && lower(*unit) != "mm")
    throw InputError("DistanceUnits", "'" + *unit + "'", "lengths must be in mm", text.path);
}

/// Throws InputError where values differ from those stored, which ITK ignores.
void check_meta_intensity(const TextHeader& text) {
  constexpr std::array<std::pair<const char*, double>, 2> kNone = {
      {{"ElementToIntensityFunctionSlope", 1.0}, {"ElementToIntensityFunctionOffset", 0.0}}};
  for (const auto& [key, none] : kNone)
    if (const auto number = meta_numbers(text, {key}, 1); !number.empty() && number[0] != none)
      throw InputError(key, *text.find(key), "must be " + number_text(none), text.path);
}

/// Whether the voxels are in the other byte order than this machine's.
bool is_meta_byte_swapped(const TextHeader& header) {
  const bool binary = is_true(header, "BinaryDataByteOrderMSB", false);
  const bool element = is_true(header, "ElementByteOrderMSB", binary);
  if (header.find("BinaryDataByteOrderMSB") != nullptr && binary != element)
    throw FileError(header.path, "BinaryDataByteOrderMSB and ElementByteOrderMSB disagree");
  return element != (std::endian::native == std::endian::big);
}

/// Where the voxels begin. HeaderSize counts from the beginning of their file; -1 means as far
/// before its end as the voxels need.
std::uint64_t meta_payload_offset(const TextHeader& text,
                                  const ImageHeader& header,
                                  bool is_local,
                                  std::uint64_t file_bytes) {
  const std::uint64_t header_end = is_local ? text.end_offset : 0;
  const std::int64_t size = text.integer("HeaderSize", 0);
  if (size == 0) return header_end;
  if (size > 0 && static_cast<std::uint64_t>(size) >= header_end)
    return static_cast<std::uint64_t>(size);
  const std::uint64_t payload = checked_payload_bytes(text.path, header);
  if (size != -1 || header.compressed || file_bytes < header_end + payload)
    throw FileError(text.path,
                    "HeaderSize",
                    "0, the beginning of the voxels in their file, or -1 (their file's last bytes, "
                    "not compressed)",
                    std::to_string(size));
  return file_bytes - payload;
}

/// The length of the compressed voxels. MetaIO needs it where they follow the header, and reads
/// zeros without it.
std::optional<std::uint64_t> meta_compressed_bytes(const TextHeader& header, bool is_local) {
  if (header.find("CompressedDataSize") == nullptr && !is_local) return std::nullopt;
  (void)header.require("CompressedDataSize");
  const std::int64_t bytes = header.integer("CompressedDataSize", 0);
  if (bytes < 1)
    throw FileError(header.path, "CompressedDataSize", "at least 1", std::to_string(bytes));
  return static_cast<std::uint64_t>(bytes);
}

}  // namespace

ImageHeader read_meta_header(const fs::path& path) {
  const TextHeader text = parse_meta_text(path);
  ImageHeader header;
  header.format = ImageFormat::MetaImage;
  header.image.size = sizes_of(text, "NDims", "DimSize");
  read_meta_place(text, header);
  check_meta_intensity(text);
  const std::int64_t channels = text.integer("ElementNumberOfChannels", 1);
  if (channels < 1 || channels > 1024)
    throw FileError(text.path, "ElementNumberOfChannels", "1 to 1024", std::to_string(channels));
  header.value_type = meta_value_type(text);
  header.image.channels = static_cast<int>(channels);
  header.is_byte_swapped = is_meta_byte_swapped(text);
  if (!is_true(text, "BinaryData", true))
    throw FileError(text.path, "BinaryData = False: text voxels are not supported");
  header.compressed = is_true(text, "CompressedData", false);
  const std::string& data_file = text.require("ElementDataFile");
  const bool local = lower(data_file) == "local";
  header.data_file = local ? path : beside(path, data_file);
  const std::uint64_t bytes = existing_file_size(path, header.data_file);
  header.payload_offset = meta_payload_offset(text, header, local, bytes);
  if (header.compressed) header.compressed_bytes = meta_compressed_bytes(text, local);
  return header;
}

}  // namespace af::image_formats
