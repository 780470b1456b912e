// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace af::test {

/// A folder for the running test alone, removed on destruction.
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

/// Fills a folder with what the tests of a program share. The first call of a process makes the
/// contents with `prepare`, and keeps a copy for later calls. Under CTest the entry NAME.prepared
/// keeps the copy (AF_PREPARE_INTO), and the entries of the tests use it (AF_PREPARED_IN).
void prepare_once(const std::filesystem::path& folder, const std::function<void()>& prepare);

}  // namespace af::test
