// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace af::test {

/// A folder of its own for the running test, removed on destruction.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// Fills a folder with what the tests of a program share. Only the first call of a process has it
/// made, by `prepare`, and keeps a copy, from which the others fill theirs. Under CTest the entry
/// NAME.prepared of the program keeps the copy (AF_PREPARE_INTO), and those of its tests take it
/// (AF_PREPARED_IN).
void prepare_once(const std::filesystem::path& folder, const std::function<void()>& prepare);

}  // namespace af::test
