// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include "base/error.h"
#include "base/parsed_number.h"
#include "base/plausible.h"
#include "images/file_bytes.h"
#include "images/image_formats.h"
#include "images/image_text_header.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

const std::string* either(const TextHeader& header, const char* a, const char* b) {
  const std::string* value = header.find(a);
  return value != nullptr ? value : header.find(b);
}

TextHeader parse_nrrd_text(const fs::path& path) {
  const std::string bytes = read_prefix(path, kMaxTextHeaderBytes);
  std::istringstream text(bytes);
  TextHeader header{path.string(), {}, bytes.size()};
  std::string line;
  std::getline(text, line);  // the mark of the format
  while (std::getline(text, line)) {
    line = trimmed(line);
    if (line.empty()) {
      if (!text.eof()) header.end_offset = static_cast<std::uint64_t>(text.tellg());
      return header;
    }
    const auto separator = line.find(':');
    if (line[0] == '#' || separator == std::string::npos) continue;
    if (line.compare(separator, 2, ":=") == 0) continue;  // a key/value pair, not a field
    header.add(lower(line.substr(0, separator)), trimmed(line.substr(separator + 1)));
  }
  // A detached header may end with its last line.
  if (bytes.size() == kMaxTextHeaderBytes || either(header, "data file", "datafile") == nullptr)
    throw FileError(path.string(), "NRRD header is cut short");
  return header;
}

ValueType nrrd_value_type(const TextHeader& header) {
  static const std::map<ValueType, std::set<std::string_view>> kNames = {
      {ValueType::Int8, {"signed char", "int8", "int8_t"}},
      {ValueType::UInt8, {"uchar", "unsigned char", "uint8", "uint8_t"}},
      {ValueType::Int16,
       {"short", "short int", "signed short", "signed short int", "int16", "int16_t"}},
      {ValueType::UInt16, {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}},
      {ValueType::Int32, {"int", "signed int", "int32", "int32_t"}},
      {ValueType::UInt32, {"uint", "unsigned int", "uint32", "uint32_t"}},
      {ValueType::Int64,
       {"longlong",
        "long long",
        "long long int",
        "signed long long",
        "signed long long int",
        "int64",
        "int64_t"}},
      {ValueType::UInt64,
       {"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"}},
      {ValueType::Float32, {"float"}},
      {ValueType::Float64, {"double"}}};
  const std::string type = lower(header.require("type"));
  for (const auto& [value_type, names] : kNames)
    if (names.contains(type)) return value_type;
  throw FileError(header.path, "type", "a number type of NRRD", "'" + type + "'");
}

/// Whether the voxels are in the other byte order than this machine's.
bool is_nrrd_byte_swapped(const TextHeader& header, ValueType type) {
  if (value_bytes(type) == 1) return false;
  const std::string endian = lower(header.require("endian"));
  if (endian != "little" && endian != "big")
    throw FileError(header.path, "endian", "little or big", "'" + endian + "'");
  return (endian == "big") != (std::endian::native == std::endian::big);
}

/// The vector "(x,y,z)"; none for anything else.
std::optional<std::vector<double>> nrrd_vector(std::string_view text) {
  if (!text.starts_with('(') || !text.ends_with(')')) return std::nullopt;
  std::vector<double> vector;
  std::istringstream numbers(std::string(text.substr(1, text.size() - 2)));
  for (std::string number; std::getline(numbers, number, ',');) {
    const std::optional<double> value = finite_number(trimmed(number));
    if (!value) return std::nullopt;
    vector.push_back(*value);
  }
  return vector;
}

double length_of(const std::vector<double>& vector) {
  double length = 0.0;
  for (const double value : vector) length = std::hypot(length, value);
  return length;
}

/// The "space directions" of an image of at most three axes: one vector per axis.
std::vector<std::vector<double>> nrrd_directions(const TextHeader& header, std::size_t axes) {
  const std::string* text = header.find("space directions");
  if (text == nullptr || axes > 3) return {};
  std::vector<std::vector<double>> directions;
  std::istringstream vectors(*text);
  bool plausible = true;
  for (std::string vector; std::getline(vectors, vector, ')');) {
    const auto found = nrrd_vector(trimmed(vector) + ")");
    plausible = plausible && found && is_plausible_spacing_mm(length_of(*found));
    directions.push_back(found.value_or(std::vector<double>()));
  }
  if (!plausible || directions.size() != axes)
    throw InputError("space directions",
                     "'" + *text + "'",
                     std::string("each axis needs a vector, whose length ") + kPlausibleSpacing,
                     header.path);
  return directions;
}

/// The signs that turn coordinates of "left-anterior-superior" (or "LAS") and the like into LPS.
/// None for spaces that are not the patient's, such as "scanner-xyz".
std::optional<std::array<double, 3>> lps_signs(const std::string& space) {
  std::string letters = space;
  if (space.find('-') != std::string::npos) {
    letters.clear();
    std::istringstream words(space);
    for (std::string word; std::getline(words, word, '-');) letters += word.substr(0, 1);
  }
  if (letters.size() == 4 && letters.back() == 't') letters.pop_back();  // with an axis of time
  constexpr std::array<std::string_view, 3> kWays = {"lr", "pa", "si"};
  if (letters.size() != kWays.size()) return std::nullopt;
  std::array<double, 3> signs{};
  for (std::size_t axis = 0; axis < kWays.size(); ++axis) {
    const std::size_t way = kWays[axis].find(letters[axis]);
    if (way == std::string_view::npos) return std::nullopt;
    signs[axis] = way == 0 ? 1.0 : -1.0;
  }
  return signs;
}

/// "spacings"; none where an axis has none ("nan").
std::vector<double> nrrd_spacings(const TextHeader& header, std::size_t axes) {
  if (header.find("spacings") == nullptr) return {};
  const std::vector<double> spacings = header.numbers("spacings");
  if (std::ranges::any_of(spacings, [](double value) { return std::isnan(value); })) return {};
  if (spacings.size() != axes)
    throw FileError(header.path,
                    "spacings",
                    std::to_string(axes) + " numbers",
                    "'" + header.require("spacings") + "'");
  return spacings;
}

/// Where the image lies.
void read_nrrd_place(const TextHeader& text, ImageHeader& header) {
  const std::size_t axes = header.image.size.size();
  set_default_place(header);
  const std::vector<std::vector<double>> directions = nrrd_directions(text, axes);
  header.image.spacing_mm = nrrd_spacings(text, axes);
  if (!directions.empty()) header.image.spacing_mm.clear();
  for (const auto& vector : directions) header.image.spacing_mm.push_back(length_of(vector));
  header.has_spacing = !header.image.spacing_mm.empty();
  header.image.spacing_mm.resize(axes, 1.0);
  const std::string* const name = text.find("space");
  const std::string space = name == nullptr ? "" : lower(*name);
  const auto signs = lps_signs(space);
  if (!signs && !space.empty() && !space.starts_with("scanner-xyz") &&
      !space.starts_with("3d-right-handed"))
    throw InputError("space",
                     *name,
                     "must be along the patient's axes, such as LPS or right-anterior-superior, or "
                     "right-handed: left would become right",
                     text.path);
  header.has_orientation = signs.has_value() && !directions.empty();
  const std::string* const place = text.find("space origin");
  const auto origin = place == nullptr ? std::vector<double>(3) : nrrd_vector(*place);
  if (!origin)
    throw InputError("space origin", "'" + *place + "'", "must be a vector of numbers", text.path);
  const bool is_in_space = axes == 3 && directions.size() == 3 && origin->size() == 3 &&
                           std::all_of(directions.begin(), directions.end(), [](const auto& v) {
                             return v.size() == 3;
                           });
  if (!is_in_space) return;
  for (std::size_t row = 0; row < 3; ++row) {
    const double sign = signs ? (*signs)[row] : 1.0;
    header.image.origin_mm[row] = sign * (*origin)[row];
    for (std::size_t axis = 0; axis < 3; ++axis)
      header.image.directions[axis][row] =
          sign * directions[axis][row] / header.image.spacing_mm[axis];
  }
}

/// Axes of colours, vectors and the like hold no voxels of their own.
void check_nrrd_kinds(const TextHeader& header) {
  const std::string* text = header.find("kinds");
  if (text == nullptr) return;
  constexpr std::array<std::string_view, 8> kOfVoxels = {
      "domain", "space", "time", "list", "stub", "scalar", "none", "???"};
  for (const std::string& word : words_of(*text))
    if (std::find(kOfVoxels.begin(), kOfVoxels.end(), lower(word)) == kOfVoxels.end())
      throw InputError(
          "kinds", *text, "one value per voxel is read: \"domain\" for every axis", header.path);
}

void check_nrrd_units(const TextHeader& header) {
  const std::string* text = header.find("space units");
  if (text == nullptr) return;
  for (const std::string& word : words_of(*text))
    if (word != "\"mm\"" && word != "\"\"")
      throw InputError("space units", *text, "lengths must be in \"mm\"", header.path);
}

}  // namespace

ImageHeader read_nrrd_header(const fs::path& path) {
  const TextHeader text = parse_nrrd_text(path);
  ImageHeader header;
  header.format = ImageFormat::Nrrd;
  header.image.size = sizes_of(text, "dimension", "sizes");
  header.value_type = nrrd_value_type(text);
  read_nrrd_place(text, header);
  check_nrrd_units(text);
  check_nrrd_kinds(text);
  const std::string encoding = lower(text.require("encoding"));
  header.compressed = encoding == "gzip" || encoding == "gz";
  if (!header.compressed && encoding != "raw")
    throw FileError(text.path, "encoding", "raw or gzip", "'" + encoding + "'");
  if (text.integer("line skip", 0) != 0 || text.integer("lineskip", 0) != 0)
    throw FileError(text.path, "'line skip' is not supported");
  const std::string* data_file = either(text, "data file", "datafile");
  header.data_file = data_file == nullptr ? path : beside(path, *data_file);
  header.payload_offset = data_file == nullptr ? text.end_offset : 0;
  const std::uint64_t bytes = existing_file_size(path, header.data_file);
  const std::int64_t skip = text.integer("byte skip", text.integer("byteskip", 0));
  const std::uint64_t payload = checked_payload_bytes(path, header);
  if (skip < (header.compressed ? 0 : -1))
    throw FileError(text.path,
                    "byte skip",
                    header.compressed ? "at least 0" : "at least -1",
                    std::to_string(skip));
  header.is_byte_swapped = is_nrrd_byte_swapped(text, header.value_type);
  if (skip > 0) header.skip_bytes = static_cast<std::uint64_t>(skip);
  if (skip == -1 && !header.compressed)
    header.payload_offset = bytes > payload ? bytes - payload : 0;
  return header;
}

}  // namespace af::image_formats
