// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "files/output_lock.h"

namespace af {

/// An output folder that appears under its name only when complete. It is filled as "NAME.partial",
/// and commit() renames it. The destructor removes it unless it was committed.
class PartialFolder {
 public:
  enum class Existing { Refuse, Replace };

  /// Creates an empty "FOLDER.partial" and its parents, removes one left by a killed run, and keeps
  /// other jobs out (OutputLock) as long as this lives. Throws InputError when another job is
  /// writing FOLDER, or when it exists with content and `existing` is Refuse, FileError when the
  /// folder cannot be created.
  PartialFolder(const std::filesystem::path& folder, Existing existing);
  ~PartialFolder();
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  /// Where to write now (absolute).
  [[nodiscard]] const std::filesystem::path& path() const { return partial_; }
  /// Where the content will stand (absolute).
  [[nodiscard]] const std::filesystem::path& final_path() const { return folder_; }
  /// Renames to the final name. An older folder of that name is removed afterwards. Throws
  /// FileError on failure.
  void commit();

 private:
  std::filesystem::path folder_;
  std::filesystem::path partial_;
  OutputLock lock_;
  bool committed_ = false;
};

}  // namespace af
