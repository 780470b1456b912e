// SPDX-License-Identifier: Apache-2.0
#include "images/image_text_header.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <iterator>
#include <optional>
#include <sstream>

#include "base/error.h"
#include "base/parsed_number.h"

namespace af::image_formats {

namespace {

std::optional<std::int64_t> parsed_integer(const std::string& text) {
  std::int64_t number = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  return error == std::errc() && stop == end ? std::optional(number) : std::nullopt;
}

}  // namespace

void TextHeader::add(const std::string& key, const std::string& value) {
  if (!fields.emplace(key, value).second)
    throw FileError(path, "header field '" + key + "' stands twice");
}

const std::string* TextHeader::find(const std::string& key) const {
  const auto found = fields.find(key);
  return found == fields.end() ? nullptr : &found->second;
}

const std::string& TextHeader::require(const std::string& key) const {
  const std::string* value = find(key);
  if (value == nullptr) throw FileError(path, "header has no '" + key + "'");
  return *value;
}

std::int64_t TextHeader::integer(const std::string& key, std::int64_t fallback) const {
  const std::string* value = find(key);
  if (value == nullptr) return fallback;
  const std::optional<std::int64_t> number = parsed_integer(*value);
  if (!number)
    throw FileError(path, "header field '" + key + "'", "an integer", "'" + *value + "'");
  return *number;
}

std::vector<double> TextHeader::numbers(const std::string& key) const {
  const std::string* text = find(key);
  if (text == nullptr) return {};
  std::vector<double> values;
  for (const std::string& word : words_of(*text)) {
    const std::optional<double> value = parsed_number(word);
    if (!value) throw FileError(path, key, "numbers", "'" + *text + "'");
    values.push_back(*value);
  }
  return values;
}

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream words(text);
  return {std::istream_iterator<std::string>(words), {}};
}

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t\r") - first + 1));
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

std::vector<std::uint64_t> sizes_of(const TextHeader& header,
                                    const std::string& dimension_key,
                                    const std::string& sizes_key) {
  constexpr std::int64_t kMostAxes = 10;
  (void)header.require(dimension_key);
  const std::int64_t dimension = header.integer(dimension_key, 0);
  if (dimension < 1 || dimension > kMostAxes)
    throw FileError(header.path, dimension_key, "1 to 10", std::to_string(dimension));
  const std::string& text = header.require(sizes_key);
  std::vector<std::uint64_t> sizes;
  for (const std::string& word : words_of(text)) {
    const std::int64_t size = parsed_integer(word).value_or(0);
    if (size < 1) throw FileError(header.path, sizes_key, "positive integers", "'" + text + "'");
    sizes.push_back(static_cast<std::uint64_t>(size));
  }
  if (static_cast<std::int64_t>(sizes.size()) != dimension)
    throw FileError(
        header.path, sizes_key, std::to_string(dimension) + " numbers", "'" + text + "'");
  return sizes;
}

std::filesystem::path beside(const std::filesystem::path& header_path, const std::string& name) {
  if (name.starts_with("LIST") || name.find('%') != std::string::npos)
    throw FileError(header_path.string(),
                    "its voxel file '" + name + "': one file per slice is not supported");
  const std::filesystem::path data(name);
  if (data.is_absolute() || std::find(data.begin(), data.end(), "..") != data.end())
    throw FileError(header_path.string(),
                    "its voxel file '" + name + "' must stand beside it or in a folder below");
  return header_path.parent_path() / data;
}

}  // namespace af::image_formats
