// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace af {

/// What unfinished work is valid for: every option and input that decides its results.
using DecidingValues = std::map<std::string, std::string>;

/// "OUTPUT.progress", beside the output: where its unfinished work lies.
std::filesystem::path progress_folder(const std::filesystem::path& output);

/// The running program's version and the beginning of its file's SHA-256: another build may compute
/// something else.
std::string program_build();

/// What decides every result of a run: this program's build, the inputs' SHA-256 by name, and the
/// options in force as TOML but for threads, comments and the paths of inputs, whose contents
/// count.
DecidingValues deciding_values(const std::string& options_toml,
                               const std::map<std::string, std::string>& input_sha256);

/// InputError that names every difference between what earlier work in `folder` was begun with and
/// what is asked for now.
void require_same(const DecidingValues& earlier,
                  const DecidingValues& now,
                  const std::filesystem::path& folder);

}  // namespace af
