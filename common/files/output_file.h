// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "files/output_lock.h"

namespace af {

/// Writes `path` so that it appears under its name only when complete. `write` fills "PATH.partial"
/// (with the extension kept last, for writers that choose a format by it: "a.partial.png"), which
/// is then closed, synced and renamed, and its folder synced. On failure nothing remains. Throws
/// FileError naming the path and the system's reason, InputError when another job is writing it
/// (OutputLock).
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& partial)>& write);

/// Checks that write_atomically() and move_into_place() may put a file there. Throws FileError when
/// its folder does not exist, or when its name or that of the unfinished file belongs to a folder,
/// a device, a pipe, a socket or a link that leads nowhere. Throws InputError when it is an input
/// (input_guard.h).
void check_output_file(const std::filesystem::path& path, const std::filesystem::path& partial);

/// For use before the work. Runs check_output_file(). From then on the file is refused as input,
/// and other jobs are kept from writing it (OutputLock), until write_atomically() has written it or
/// this process ends.
void announce_output(const std::filesystem::path& path);
/// The same, except for the lock, for files that will stand in a folder, if it exists already.
/// Throws FileError when it is no folder. The lock is the folder's.
void announce_outputs(const std::filesystem::path& folder, const std::vector<std::string>& names);

/// Removes a file of an earlier run, if there is one. Throws InputError when it is an input.
void remove_output(const std::filesystem::path& path);

/// write_atomically() with a text.
void write_text_file(const std::filesystem::path& path, std::string_view text);

/// write_atomically() with the texts that `next_part` returns, up to the first empty one. For files
/// too long to be held in memory.
void write_text_in_parts(const std::filesystem::path& path,
                         const std::function<std::string()>& next_part);

/// Makes sure that what was written to a file or folder survives a crash of the machine (fsync).
/// Throws FileError when it cannot.
void sync_path(const std::filesystem::path& path);

/// Syncs a complete file and gives it its name, in one step. Throws FileError when it cannot, or
/// when what has that name must not be replaced (check_output_file()).
void move_into_place(const std::filesystem::path& partial, const std::filesystem::path& path);

/// Windows begins UTF-8 texts with this mark. It is no part of a text that is read here.
inline constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// A file's text from its beginning, for files of any length. Throws FileError when unreadable.
class TextParts {
 public:
  explicit TextParts(const std::filesystem::path& path);
  ~TextParts();
  /// Valid until the next call; empty at the end of the file.
  std::string_view next();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

/// The whole file as text, noted as an input. Throws FileError when unreadable or larger than
/// `max_bytes`.
std::string read_text_file(const std::filesystem::path& path, std::size_t max_bytes = 256u << 20);
/// The same for what the program itself keeps for later, such as unfinished work. It is no input.
std::string read_own_text_file(const std::filesystem::path& path,
                               std::size_t max_bytes = 256u << 20);

/// A name (of a case, a camera) as part of a file name: all characters but letters, digits, - and _
/// become _.
std::string file_name_part(std::string name);

/// Creates a folder with its parents, and checks that files can be made in it. This is for a part
/// of an output: make_output_folder() makes a whole one.
void make_folder(const std::filesystem::path& folder);
/// make_folder(), which also keeps other jobs from writing there as long as the lock lives.
[[nodiscard]] OutputLock make_output_folder(const std::filesystem::path& folder);

}  // namespace af
