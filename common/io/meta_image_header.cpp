// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <cmath>
#include <map>
#include <sstream>

#include "base/error.h"
#include "io/image_formats.h"
#include "io/image_text_header.h"
#include "io/stored_bytes.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

TextHeader parse_meta_text(const fs::path& path) {
  const std::string text = read_prefix(path, kMaxTextHeaderBytes);
  TextHeader header{path.string(), {}, 0};
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos) {
      // A header file may end without a newline after its last line.
      if (text.size() == kMaxTextHeaderBytes || text.find('\0', at) != std::string::npos) break;
    }
    const std::string_view line =
        std::string_view(text).substr(at, end == std::string::npos ? std::string::npos : end - at);
    at = end == std::string::npos ? text.size() : end + 1;
    const auto separator = line.find_first_of("=:");
    if (separator == std::string_view::npos) {
      if (trimmed(line).empty()) continue;
      break;
    }
    const std::string key = trimmed(line.substr(0, separator));
    header.fields[key] = trimmed(line.substr(separator + 1));
    if (key == "ElementDataFile") {
      header.end_offset = at;
      return header;
    }
  }
  throw FileError(path.string(), "MetaImage header ends without ElementDataFile");
}

std::uint64_t meta_type_bytes(const TextHeader& header) {
  static const std::map<std::string, std::uint64_t> bytes_of_type = {{"MET_CHAR", 1},
                                                                     {"MET_UCHAR", 1},
                                                                     {"MET_SHORT", 2},
                                                                     {"MET_USHORT", 2},
                                                                     {"MET_INT", 4},
                                                                     {"MET_UINT", 4},
                                                                     {"MET_LONG", 4},
                                                                     {"MET_ULONG", 4},
                                                                     {"MET_LONG_LONG", 8},
                                                                     {"MET_ULONG_LONG", 8},
                                                                     {"MET_FLOAT", 4},
                                                                     {"MET_DOUBLE", 8}};
  const std::string& type = header.require("ElementType");
  const auto found = bytes_of_type.find(type);
  if (found == bytes_of_type.end())
    throw FileError(header.path, "ElementType", "one of MET_CHAR ... MET_DOUBLE", type);
  return found->second;
}

bool is_true(const TextHeader& header, const std::string& key, bool fallback) {
  const std::string* value = header.find(key);
  if (value == nullptr || value->empty()) return fallback;
  return (*value)[0] == 'T' || (*value)[0] == 't' || (*value)[0] == '1';
}

void check_meta_numbers(const TextHeader& header, const std::string& key, std::int64_t expected) {
  const std::string* text = header.find(key);
  if (text == nullptr) return;
  std::int64_t count = 0;
  std::istringstream words(*text);
  for (std::string word; words >> word; ++count) {
    double value = 0.0;
    const char* first = word.data() + (word[0] == '+' ? 1 : 0);
    const auto [end, error] = std::from_chars(first, word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size())
      throw FileError(header.path, key, "numbers", "'" + *text + "'");
    if (!std::isfinite(value))
      throw InputError(key, "'" + *text + "'", "must be finite", header.path);
  }
  if (count != expected)
    throw FileError(header.path, key, std::to_string(expected) + " numbers", "'" + *text + "'");
}

/// MetaIO prints to the terminal when numbers are missing or are none.
void check_meta_numbers(const TextHeader& header, std::int64_t dimension) {
  for (const char* key : {"TransformMatrix", "Rotation", "Orientation"})
    check_meta_numbers(header, key, dimension * dimension);
  for (const char* key :
       {"ElementSpacing", "ElementSize", "Offset", "Position", "Origin", "CenterOfRotation"})
    check_meta_numbers(header, key, dimension);
}

}  // namespace

ImageHeader read_meta_header(const fs::path& path) {
  const TextHeader text = parse_meta_text(path);
  ImageHeader header;
  header.format = ImageFormat::MetaImage;
  const std::int64_t dimension = checked_dimension(text, "NDims");
  header.size = parse_sizes(text.path, text.require("DimSize"), dimension);
  check_meta_numbers(text, dimension);
  const std::int64_t channels = text.integer("ElementNumberOfChannels", 1);
  if (channels < 1 || channels > 1024)
    throw FileError(text.path, "ElementNumberOfChannels", "1 to 1024", std::to_string(channels));
  header.value_bytes = meta_type_bytes(text) * static_cast<std::uint64_t>(channels);
  if (!is_true(text, "BinaryData", true))
    throw FileError(text.path, "BinaryData = False: text voxels are not supported");
  header.compressed = is_true(text, "CompressedData", false);
  header.has_orientation = text.find("TransformMatrix") != nullptr ||
                           text.find("Rotation") != nullptr || text.find("Orientation") != nullptr;
  const std::string& data_file = text.require("ElementDataFile");
  const std::string kind = lower(data_file);
  if (kind.starts_with("list") || data_file.find('%') != std::string::npos)
    throw FileError(text.path,
                    "ElementDataFile = " + data_file +
                        ": one file per slice is not supported; give one raw file");
  const bool local = kind == "local";
  header.data_file = local ? path : beside(path, data_file);
  const std::uint64_t bytes = existing_file_size(path, header.data_file);
  const std::int64_t header_size = text.integer("HeaderSize", 0);
  const std::uint64_t payload = checked_payload_bytes(path, header);
  header.payload_offset = local ? text.end_offset : 0;
  if (header_size > 0) header.payload_offset = static_cast<std::uint64_t>(header_size);
  if (header_size == -1 && !header.compressed)
    header.payload_offset = bytes > payload ? bytes - payload : 0;
  return header;
}

}  // namespace af::image_formats
