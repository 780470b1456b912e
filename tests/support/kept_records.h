// SPDX-License-Identifier: Apache-2.0
// Finished work as it is on disk, read by other code than the code under test.
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>

#include "files/output_file.h"

namespace af::test {

template <typename T>
T number_at(const std::string& bytes, std::size_t position) {
  T number{};
  std::memcpy(&number, bytes.data() + position, sizeof(T));
  return number;
}

/// Whole records of all processes and runs in a journal's folder.
inline std::uint64_t kept_records(const std::filesystem::path& folder) {
  std::uint64_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".records") continue;
    const std::string records = read_text_file(entry.path());
    constexpr std::size_t kHeaderBytes = 16;
    for (std::size_t at = 0; at + kHeaderBytes <= records.size(); ++count) {
      at += kHeaderBytes + number_at<std::uint32_t>(records, at + 4);
      if (at > records.size()) break;
    }
  }
  return count;
}

}  // namespace af::test
