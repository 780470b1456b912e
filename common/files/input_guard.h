// SPDX-License-Identifier: Apache-2.0
// Keeps a program from overwriting what it reads. Readers note the files they open, and code that
// renames or removes a file asks here first. Files are identified by device and inode, which sees
// through links and other spellings of a path. A file that this process has written itself is no
// input: it may be read back and written again.
#pragma once

#include <filesystem>

namespace af {

/// Notes a file or folder that is read as input. Throws InputError when it is, or lies in, an
/// announced output. Does nothing when there is no such file, because its reader will report that.
void note_input(const std::filesystem::path& path);

/// Throws InputError when `path` is a file noted as input.
void refuse_input(const std::filesystem::path& path);

/// Throws InputError when a noted input is `folder` or lies within it. For use before the folder is
/// replaced or removed as a whole.
void refuse_inputs_within(const std::filesystem::path& folder);

/// From now on note_input() refuses this file, if there is one, as well.
void announce_output_file(const std::filesystem::path& path);

/// From now on note_input() refuses this folder and whatever lies within.
void announce_replaced_folder(const std::filesystem::path& folder);

/// Notes that this process has written the file of this name.
void note_written(const std::filesystem::path& path);

}  // namespace af
