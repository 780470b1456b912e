// SPDX-License-Identifier: Apache-2.0
// Text headers of images: MetaImage's and NRRD's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace af::image_formats {

inline constexpr std::size_t kMaxTextHeaderBytes = 1u << 20;

/// "key = value" or "key: value" lines of a text header, and where it ends. MetaIO wants its keys
/// in their exact case; NRRD fields are kept in lower case.
struct TextHeader {
  std::string path;
  std::map<std::string, std::string> fields;
  std::uint64_t end_offset = 0;

  /// Throws FileError when the key is already there: readers differ in which of two they take.
  void add(const std::string& key, const std::string& value);
  /// nullptr when the header does not have it.
  [[nodiscard]] const std::string* find(const std::string& key) const;
  /// FileError when the header does not have it.
  [[nodiscard]] const std::string& require(const std::string& key) const;
  /// Throws FileError when it is no integer.
  [[nodiscard]] std::int64_t integer(const std::string& key, std::int64_t fallback) const;
  /// Numbers between blanks, of any count and value; none when the header does not have the key.
  /// Throws FileError when it holds anything else.
  [[nodiscard]] std::vector<double> numbers(const std::string& key) const;
};

std::vector<std::string> words_of(const std::string& text);

/// The text without blanks at both ends.
std::string trimmed(std::string_view text);
std::string lower(std::string text);

/// Voxels per axis, for 1 to 10 axes. Throws FileError when they are no positive integers, or
/// another number of them than the header says.
std::vector<std::uint64_t> sizes_of(const TextHeader& header,
                                    const std::string& dimension_key,
                                    const std::string& sizes_key);

/// The voxel file that a header names, relative to the header. Throws FileError when that leads out
/// of the header's folder: an image from elsewhere must not show the content of the reader's other
/// files. Also throws FileError for one file per slice.
std::filesystem::path beside(const std::filesystem::path& header_path, const std::string& name);

}  // namespace af::image_formats
