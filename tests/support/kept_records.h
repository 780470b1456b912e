// SPDX-License-Identifier: Apache-2.0
// Reads finished work from disk, by other code than the code under test.
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "files/output_file.h"

namespace af::test {

template <typename T>
T number_at(const std::string& bytes, std::size_t position) {
  T number{};
  std::memcpy(&number, bytes.data() + position, sizeof(T));
  return number;
}

/// Whether a file holds records of the journal of this name, or of any journal when the name is
/// empty.
inline bool is_of_journal(const std::filesystem::path& file, const std::string& journal) {
  return file.extension() == ".records" && file.filename().string().starts_with(journal);
}

/// The keys of all complete records in a folder, of all processes and runs, from one journal or
/// all.
inline std::vector<std::int64_t> kept_keys(const std::filesystem::path& folder,
                                           const std::string& journal = {}) {
  std::vector<std::int64_t> keys;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (!is_of_journal(entry.path(), journal)) continue;
    const std::string records = read_text_file(entry.path());
    constexpr std::size_t kHeaderBytes = 32;
    for (std::size_t at = 0; at + kHeaderBytes <= records.size();) {
      const auto key = number_at<std::int64_t>(records, at + 8);
      at += kHeaderBytes + number_at<std::uint64_t>(records, at + 16);
      if (at > records.size()) break;
      keys.push_back(key);
    }
  }
  return keys;
}

inline std::uint64_t kept_records(const std::filesystem::path& folder,
                                  const std::string& journal = {}) {
  return kept_keys(folder, journal).size();
}

}  // namespace af::test
