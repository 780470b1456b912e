// SPDX-License-Identifier: Apache-2.0
#include "files/input_guard.h"

#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <sys/stat.h>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/fork_aware_mutex.h"

namespace af {

namespace {

namespace fs = std::filesystem;

using FileId = std::pair<dev_t, ino_t>;

/// Status of what a path leads to, with links followed.
std::optional<struct stat> status_of(const fs::path& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return std::nullopt;
  return status;
}

FileId id_of(const struct stat& status) {
  return {status.st_dev, status.st_ino};
}

std::optional<FileId> id_of(const fs::path& path) {
  const auto status = status_of(path);
  return status ? std::optional(id_of(*status)) : std::nullopt;
}

/// When it was written, s and ns. The inode's number alone is not enough: it is reused once a file
/// is gone.
using WriteTime = std::pair<time_t, long>;

WriteTime write_time_of(const struct stat& status) {
  return {status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
}

fs::path canonical_path(const fs::path& path) {
  std::error_code error;
  fs::path canonical = fs::weakly_canonical(fs::absolute(path, error), error);
  return error ? path : canonical;
}

/// Both paths are canonical.
bool is_within(const fs::path& path, const fs::path& folder) {
  const fs::path relative = path.lexically_relative(folder);
  return !relative.empty() && *relative.begin() != "..";
}

[[noreturn]] void refuse_output(const fs::path& output, const fs::path& input) {
  throw InputError("output",
                   "'" + output.string() + "'",
                   "would replace the input '" + input.string() + "': choose another name");
}

/// One for the whole process, because some parts of a program read and others write.
class InputGuard {
 public:
  static InputGuard& instance() {
    static InputGuard guard;
    return guard;
  }

  void note_input(const fs::path& path) {
    const std::lock_guard lock(mutex_);
    const auto status = status_of(path);
    if (!status) return;
    const std::optional<FileId> id = id_of(*status);
    const auto written = written_.find(*id);
    if (written != written_.end() && written->second == write_time_of(*status)) return;
    if (const auto output = outputs_.find(*id);
        output != outputs_.end() && id_of(output->second) == id)
      refuse_output(output->second, path);
    inputs_[*id] = path;
    for (const fs::path& folder : replaced_folders_)
      if (is_within(canonical_path(path), folder)) refuse_output(folder, path);
  }

  void refuse_input(const fs::path& path) {
    const std::lock_guard lock(mutex_);
    const std::optional<FileId> id = id_of(path);
    if (!id) return;
    // The number of an input that is gone may belong to another file now.
    if (const auto input = inputs_.find(*id); input != inputs_.end() && id_of(input->second) == id)
      refuse_output(path, input->second);
  }

  void refuse_inputs_within(const fs::path& folder) {
    const std::lock_guard lock(mutex_);
    const fs::path canonical = canonical_path(folder);
    for (const auto& [id, input] : inputs_)
      if (is_within(canonical_path(input), canonical)) refuse_output(folder, input);
  }

  void announce_output_file(const fs::path& path) {
    const std::lock_guard lock(mutex_);
    if (const std::optional<FileId> id = id_of(path)) outputs_.emplace(*id, path);
  }

  void announce_replaced_folder(const fs::path& folder) {
    const std::lock_guard lock(mutex_);
    replaced_folders_.push_back(canonical_path(folder));
  }

  void note_written(const fs::path& path) {
    const std::lock_guard lock(mutex_);
    const auto status = status_of(path);
    if (!status) return;
    // The file that had this number before is gone.
    inputs_.erase(id_of(*status));
    outputs_.erase(id_of(*status));
    written_[id_of(*status)] = write_time_of(*status);
  }

 private:
  ForkAwareMutex mutex_;
  std::map<FileId, fs::path> inputs_;
  std::map<FileId, fs::path> outputs_;
  std::vector<fs::path> replaced_folders_;
  std::map<FileId, WriteTime> written_;
};

}  // namespace

void note_input(const fs::path& path) {
  InputGuard::instance().note_input(path);
}

void refuse_input(const fs::path& path) {
  InputGuard::instance().refuse_input(path);
}

void refuse_inputs_within(const fs::path& folder) {
  InputGuard::instance().refuse_inputs_within(folder);
}

void announce_output_file(const fs::path& path) {
  InputGuard::instance().announce_output_file(path);
}

void announce_replaced_folder(const fs::path& folder) {
  InputGuard::instance().announce_replaced_folder(folder);
}

void note_written(const fs::path& path) {
  InputGuard::instance().note_written(path);
}

}  // namespace af
