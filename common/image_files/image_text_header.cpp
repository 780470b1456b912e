// SPDX-License-Identifier: Apache-2.0
#include "image_files/image_text_header.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <sstream>

#include "base/error.h"

namespace af::image_formats {

namespace {

std::uint64_t checked_extent(const std::string& path, const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number == 0)
    throw FileError(path, "size of an axis", "a positive integer", "'" + text + "'");
  return number;
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
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(value->data(), value->data() + value->size(), number);
  if (error != std::errc() || end != value->data() + value->size())
    throw FileError(path, "header field '" + key + "'", "an integer", "'" + *value + "'");
  return number;
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

std::vector<std::uint64_t> parse_sizes(const std::string& path,
                                       const std::string& text,
                                       std::int64_t dimension) {
  std::istringstream words(text);
  std::vector<std::uint64_t> sizes;
  for (std::string word; words >> word;) sizes.push_back(checked_extent(path, word));
  if (static_cast<std::int64_t>(sizes.size()) != dimension)
    throw FileError(path, "sizes", std::to_string(dimension) + " numbers", "'" + text + "'");
  return sizes;
}

std::int64_t checked_dimension(const TextHeader& header, const std::string& key) {
  (void)header.require(key);
  const std::int64_t dimension = header.integer(key, 0);
  if (dimension < 1 || dimension > 10)
    throw FileError(header.path, key, "1 to 10", std::to_string(dimension));
  return dimension;
}

std::filesystem::path beside(const std::filesystem::path& header_path, const std::string& name) {
  const std::filesystem::path data(name);
  if (data.is_absolute() || std::find(data.begin(), data.end(), "..") != data.end())
    throw FileError(header_path.string(),
                    "its voxel file '" + name + "' must stand beside it or in a folder below");
  return header_path.parent_path() / data;
}

}  // namespace af::image_formats
