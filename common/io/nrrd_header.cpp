// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>

#include "base/error.h"
#include "io/image_formats.h"
#include "io/image_text_header.h"
#include "io/stored_bytes.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

TextHeader parse_nrrd_text(const fs::path& path) {
  const std::string text = read_prefix(path, kMaxTextHeaderBytes);
  TextHeader header{path.string(), {}, 0};
  std::size_t at = text.find('\n');
  if (at == std::string::npos) throw FileError(path.string(), "NRRD header is cut short");
  for (++at; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line = trimmed(std::string_view(text).substr(at, end - at));
    at = std::min(end + 1, text.size());
    if (line.empty()) {
      header.end_offset = at;
      return header;
    }
    const auto separator = line.find(':');
    if (line[0] == '#' || separator == std::string::npos) continue;
    if (line.compare(separator, 2, ":=") == 0) continue;  // a key/value pair, not a field
    header.fields[lower(line.substr(0, separator))] =
        trimmed(std::string_view(line).substr(separator + 1));
  }
  // A detached header may end with its last line.
  if (text.size() == kMaxTextHeaderBytes ||
      (header.find("data file") == nullptr && header.find("datafile") == nullptr))
    throw FileError(path.string(), "NRRD header is cut short");
  header.end_offset = text.size();
  return header;
}

std::uint64_t nrrd_type_bytes(const TextHeader& header) {
  static const std::map<std::string, std::uint64_t> bytes_of_type = {{"signed char", 1},
                                                                     {"int8", 1},
                                                                     {"int8_t", 1},
                                                                     {"uchar", 1},
                                                                     {"unsigned char", 1},
                                                                     {"uint8", 1},
                                                                     {"uint8_t", 1},
                                                                     {"short", 2},
                                                                     {"short int", 2},
                                                                     {"signed short", 2},
                                                                     {"signed short int", 2},
                                                                     {"int16", 2},
                                                                     {"int16_t", 2},
                                                                     {"ushort", 2},
                                                                     {"unsigned short", 2},
                                                                     {"unsigned short int", 2},
                                                                     {"uint16", 2},
                                                                     {"uint16_t", 2},
                                                                     {"int", 4},
                                                                     {"signed int", 4},
                                                                     {"int32", 4},
                                                                     {"int32_t", 4},
                                                                     {"uint", 4},
                                                                     {"unsigned int", 4},
                                                                     {"uint32", 4},
                                                                     {"uint32_t", 4},
                                                                     {"longlong", 8},
                                                                     {"long long", 8},
                                                                     {"long long int", 8},
                                                                     {"signed long long", 8},
                                                                     {"signed long long int", 8},
                                                                     {"int64", 8},
                                                                     {"int64_t", 8},
                                                                     {"ulonglong", 8},
                                                                     {"unsigned long long", 8},
                                                                     {"unsigned long long int", 8},
                                                                     {"uint64", 8},
                                                                     {"uint64_t", 8},
                                                                     {"float", 4},
                                                                     {"double", 8}};
  const std::string type = lower(header.require("type"));
  const auto found = bytes_of_type.find(type);
  if (found == bytes_of_type.end())
    throw FileError(header.path, "type", "a number type of NRRD", "'" + type + "'");
  return found->second;
}

const std::string* either(const TextHeader& header, const char* a, const char* b) {
  const std::string* value = header.find(a);
  return value != nullptr ? value : header.find(b);
}

}  // namespace

ImageHeader read_nrrd_header(const fs::path& path) {
  const TextHeader text = parse_nrrd_text(path);
  ImageHeader header;
  header.format = ImageFormat::Nrrd;
  const std::int64_t dimension = checked_dimension(text, "dimension");
  header.size = parse_sizes(text.path, text.require("sizes"), dimension);
  header.value_bytes = nrrd_type_bytes(text);
  header.has_orientation = text.find("space directions") != nullptr;
  const std::string encoding = lower(text.require("encoding"));
  header.compressed = encoding == "gzip" || encoding == "gz";
  if (!header.compressed && encoding != "raw")
    throw FileError(text.path, "encoding", "raw or gzip", "'" + encoding + "'");
  if (text.integer("line skip", 0) != 0 || text.integer("lineskip", 0) != 0)
    throw FileError(text.path, "'line skip' is not supported");
  const std::string* data_file = either(text, "data file", "datafile");
  if (data_file != nullptr &&
      (data_file->starts_with("LIST") || data_file->find('%') != std::string::npos))
    throw FileError(text.path,
                    "data file: " + *data_file + ": one file per slice is not supported");
  header.data_file = data_file == nullptr ? path : beside(path, *data_file);
  header.payload_offset = data_file == nullptr ? text.end_offset : 0;
  const std::uint64_t bytes = existing_file_size(path, header.data_file);
  const std::int64_t skip = text.integer("byte skip", text.integer("byteskip", 0));
  const std::uint64_t payload = checked_payload_bytes(path, header);
  if (skip > 0) header.skip_bytes = static_cast<std::uint64_t>(skip);
  if (skip == -1 && !header.compressed)
    header.payload_offset = bytes > payload ? bytes - payload : 0;
  return header;
}

}  // namespace af::image_formats
