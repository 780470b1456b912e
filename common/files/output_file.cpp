// SPDX-License-Identifier: Apache-2.0
#include "files/output_file.h"

#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <map>
#include <mutex>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>
#include <vector>

#include "base/error.h"
#include "files/input_file.h"
#include "files/input_guard.h"

namespace af {

namespace {

namespace fs = std::filesystem;

std::string because(const std::string& what, int error_number) {
  return what + ": " + std::generic_category().message(error_number);
}

/// An open file descriptor. close() reports errors, which the destructor cannot.
class Descriptor {
 public:
  Descriptor(const fs::path& path, int flags, mode_t mode = 0)
      : path_(path.string()), number_(open(path.c_str(), flags | O_CLOEXEC, mode)) {
    if (number_ < 0) throw FileError(path_, because("cannot be opened", errno));
  }
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  void write(std::string_view text) const {
    while (!text.empty()) {
      const ssize_t count = ::write(number_, text.data(), text.size());
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) throw FileError(path_, because("cannot be written", errno));
      text.remove_prefix(static_cast<std::size_t>(count));
    }
  }
  /// The next bytes, at most buffer.size(); 0 at the end.
  std::size_t read(std::vector<char>& buffer) const {
    for (;;) {
      const ssize_t count = ::read(number_, buffer.data(), buffer.size());
      if (count >= 0) return static_cast<std::size_t>(count);
      if (errno != EINTR) throw FileError(path_, because("cannot be read", errno));
    }
  }
  void flush_to_disk() const {
    // Some file systems cannot sync a folder and report EINVAL. Nothing more can be done there.
    if (fsync(number_) != 0 && errno != EINVAL)
      throw FileError(path_, because("cannot be synced to disk", errno));
  }
  void close() {
    if (::close(std::exchange(number_, -1)) != 0)
      throw FileError(path_, because("cannot be closed", errno));
  }

 private:
  std::string path_;
  int number_;
};

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

/// "a.mha" -> "a.partial.mha", "a.nii.gz" -> "a.partial.nii.gz", "a" -> "a.partial".
fs::path partial_path(const fs::path& path) {
  fs::path stem = path.stem();
  std::string extension = path.extension().string();
  if (extension == ".gz" && stem.has_extension()) {
    extension = stem.extension().string() + extension;
    stem = stem.stem();
  }
  return path.parent_path() / (stem.string() + ".partial" + extension);
}

/// Refuses what a rename or a removal would destroy.
void check_may_be_replaced(const fs::path& path) {
  std::error_code ignored;
  // A rename would replace a folder, or a device such as /dev/null, by a plain file.
  if (fs::exists(path, ignored) && !fs::is_regular_file(path, ignored))
    throw FileError(path.string(), "exists and is not a regular file");
  if (!fs::exists(path, ignored) && fs::is_symlink(path, ignored))
    throw FileError(
        path.string(),
        "is a link to '" + fs::read_symlink(path, ignored).string() + "', which does not exist");
  refuse_input(path);
}

void write_and_rename(const fs::path& path,
                      const fs::path& partial,
                      const std::function<void(const fs::path&)>& write) {
  write(partial);
  std::error_code ignored;
  if (!fs::is_regular_file(partial, ignored))
    throw FileError(path.string(), "its writer made no file");
  move_into_place(partial, path);
}

/// write_atomically() by way of `write`.
void write_new_file(const fs::path& path, const std::function<void(const Descriptor&)>& write) {
  write_atomically(path, [&](const fs::path& partial) {
    constexpr mode_t kMode = 0666;  // before the umask
    Descriptor file(partial, O_WRONLY | O_CREAT | O_EXCL, kMode);
    write(file);
    file.close();
  });
}

/// The locks of outputs that are announced and not yet written.
class AnnouncedLocks {
 public:
  static AnnouncedLocks& instance() {
    static AnnouncedLocks locks;
    return locks;
  }

  void take(const fs::path& path) {
    const std::scoped_lock lock(mutex_);
    if (!locks_.contains(path)) locks_.emplace(path, OutputLock(path));
  }
  /// The lock of an output that is written now: its announced one, or a new one.
  OutputLock of(const fs::path& path) {
    const std::scoped_lock lock(mutex_);
    const auto announced = locks_.extract(path);
    return announced ? std::move(announced.mapped()) : OutputLock(path);
  }

 private:
  std::mutex mutex_;
  std::map<fs::path, OutputLock> locks_;
};

void announce_unlocked(const fs::path& path) {
  const fs::path partial = partial_path(path);
  check_output_file(path, partial);
  announce_output_file(path);
  announce_output_file(partial);
}

}  // namespace

void check_output_file(const fs::path& path, const fs::path& partial) {
  if (!path.has_filename()) throw FileError(path.string(), "is not the name of a file to write");
  std::error_code ignored;
  const fs::path folder = folder_of(path);
  if (!fs::exists(folder, ignored))
    throw FileError(path.string(), "its folder '" + folder.string() + "' does not exist");
  if (!fs::is_directory(folder, ignored))
    throw FileError(path.string(), "'" + folder.string() + "' is not a folder");
  check_may_be_replaced(path);
  check_may_be_replaced(partial);
}

void announce_output(const fs::path& path) {
  announce_unlocked(path);
  AnnouncedLocks::instance().take(path);
}

void announce_outputs(const fs::path& folder, const std::vector<std::string>& names) {
  std::error_code ignored;
  if (!fs::exists(fs::symlink_status(folder, ignored))) return;
  if (!fs::is_directory(folder, ignored))
    throw FileError(folder.string(), "exists and is not a folder");
  for (const std::string& name : names) announce_unlocked(folder / name);
}

void remove_output(const fs::path& path) {
  refuse_input(path);
  fs::remove(path);
}

void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& partial)>& write) {
  const fs::path partial = partial_path(path);
  check_output_file(path, partial);
  const OutputLock lock = AnnouncedLocks::instance().of(path);
  const auto remove_partial = [&] {
    std::error_code ignored;
    fs::remove(partial, ignored);
  };
  remove_partial();
  try {
    write_and_rename(path, partial, write);
  } catch (const std::system_error& error) {  // from std::filesystem and streams
    remove_partial();
    throw FileError(path.string(), std::string("cannot be written: ") + error.what());
  } catch (...) {
    remove_partial();
    throw;
  }
}

void write_text_file(const std::filesystem::path& path, std::string_view text) {
  write_new_file(path, [&](const Descriptor& file) { file.write(text); });
}

void write_text_in_parts(const std::filesystem::path& path,
                         const std::function<std::string()>& next_part) {
  write_new_file(path, [&](const Descriptor& file) {
    for (std::string part = next_part(); !part.empty(); part = next_part()) file.write(part);
  });
}

void sync_path(const fs::path& path) {
  Descriptor descriptor(path, O_RDONLY);
  descriptor.flush_to_disk();
  descriptor.close();
}

void move_into_place(const fs::path& partial, const fs::path& path) {
  check_may_be_replaced(path);
  sync_path(partial);
  if (rename(partial.c_str(), path.c_str()) != 0)
    throw FileError(path.string(), because("cannot be renamed from " + partial.string(), errno));
  note_written(path);
  sync_path(folder_of(path));
}

struct TextParts::File {
  Descriptor descriptor;
  std::vector<char> buffer = std::vector<char>(std::size_t{64} << 10);
  bool is_begun = false;
};

TextParts::TextParts(const std::filesystem::path& path)
    : file_([&path] {
        require_regular_file(path);
        return new File{Descriptor(path, O_RDONLY)};
      }()) {}

TextParts::~TextParts() = default;

std::string_view TextParts::next() {
  std::string_view part{file_->buffer.data(), file_->descriptor.read(file_->buffer)};
  if (!std::exchange(file_->is_begun, true) && part.starts_with(kByteOrderMark))
    part.remove_prefix(kByteOrderMark.size());
  return part;
}

std::string read_text_file(const std::filesystem::path& path, std::size_t max_bytes) {
  note_input(path);
  return read_own_text_file(path, max_bytes);
}

std::string read_own_text_file(const std::filesystem::path& path, std::size_t max_bytes) {
  TextParts parts(path);
  std::string text;
  for (std::string_view part = parts.next(); !part.empty(); part = parts.next()) {
    if (part.size() > max_bytes - text.size())
      throw FileError(path.string(),
                      "is larger than the " + std::to_string(max_bytes) + " bytes allowed here");
    text += part;
  }
  return text;
}

std::string file_name_part(std::string name) {
  for (char& character : name) {
    const auto code = static_cast<unsigned char>(character);
    if (std::isalnum(code) == 0 && character != '-' && character != '_') character = '_';
  }
  return name;
}

OutputLock make_output_folder(const std::filesystem::path& folder) {
  make_folder(folder);
  return OutputLock(folder);
}

void make_folder(const std::filesystem::path& folder) {
  if (folder.empty()) throw FileError("output folder", "its name is empty");
  std::error_code error;
  fs::create_directories(folder, error);
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored))
    throw FileError(folder.string(),
                    error ? "cannot be created: " + error.message()
                          : std::string("exists and is not a folder"));
  std::string probe = (folder / ".probe-XXXXXX").string();
  const int descriptor = mkostemp(probe.data(), O_CLOEXEC);
  if (descriptor < 0) throw FileError(folder.string(), because("cannot be written to", errno));
  ::close(descriptor);
  unlink(probe.c_str());
}

}  // namespace af
