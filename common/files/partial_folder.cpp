// SPDX-License-Identifier: Apache-2.0
#include "files/partial_folder.h"

#include <system_error>

#include "base/error.h"
#include "files/input_guard.h"
#include "files/output_file.h"

namespace af {

namespace {

namespace fs = std::filesystem;

/// Locks a folder that has a parent in which the lock can stand.
OutputLock locked(const fs::path& folder) {
  make_folder(folder.parent_path());
  return OutputLock(folder);
}

fs::path with_suffix(const fs::path& folder, const std::string& suffix) {
  return folder.parent_path() / (folder.filename().string() + suffix);
}

/// Absolute, and without "." or a trailing slash, so that a suffix can be appended to the folder's
/// name.
fs::path normal_folder(const fs::path& folder) {
  fs::path normal = fs::absolute(folder).lexically_normal();
  if (!normal.has_filename()) normal = normal.parent_path();
  if (!normal.has_filename()) throw InputError("output folder", folder.string(), "has no name");
  return normal;
}

void rename_or_throw(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error)
    throw FileError(to.string(),
                    "cannot be renamed from " + from.string() + ": " + error.message());
}

bool is_free(const fs::path& folder) {
  std::error_code ignored;
  return !fs::exists(fs::symlink_status(folder, ignored)) ||
         (fs::is_directory(folder, ignored) && fs::is_empty(folder, ignored));
}

}  // namespace

PartialFolder::PartialFolder(const fs::path& folder, Existing existing)
    : folder_(normal_folder(folder)),
      partial_(with_suffix(folder_, ".partial")),
      lock_(locked(folder_)) {
  std::error_code error;
  if (!is_free(folder_)) {
    if (!fs::is_directory(folder_, error))
      throw InputError("output folder", folder_.string(), "is the name of a file");
    if (existing == Existing::Refuse)
      throw InputError(
          "output folder", folder_.string(), "exists: choose another name or replace it (--force)");
  }
  for (const fs::path& replaced : {folder_, partial_, with_suffix(folder_, ".old")}) {
    refuse_inputs_within(replaced);
    announce_replaced_folder(replaced);
  }
  fs::remove_all(partial_, error);
  if (error) throw FileError(partial_.string(), "cannot be removed: " + error.message());
  make_folder(partial_);
}

PartialFolder::~PartialFolder() {
  std::error_code ignored;
  if (!committed_) fs::remove_all(partial_, ignored);
}

void PartialFolder::commit() {
  check(!committed_, "a folder is committed once");
  const fs::path old = with_suffix(folder_, ".old");
  const bool replaces = !is_free(folder_);
  if (replaces) refuse_inputs_within(folder_);
  std::error_code ignored;
  if (replaces) {
    fs::remove_all(old, ignored);
    rename_or_throw(folder_, old);
  }
  rename_or_throw(partial_, folder_);
  committed_ = true;
  if (replaces) fs::remove_all(old, ignored);
}

}  // namespace af
