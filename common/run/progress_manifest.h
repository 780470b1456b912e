// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace af {

/// What unfinished work is valid for: every option and input that decides its results.
using DecidingValues = std::map<std::string, std::string>;

/// "OUTPUT.progress", beside the output: where its unfinished work lies.
std::filesystem::path progress_folder(const std::filesystem::path& output);

/// The running program's version and the beginning of its file's SHA-256: another build may compute
/// something else.
std::string program_build();

/// What decides every result of a run: this program's build, the inputs' SHA-256 by name, and
/// deciding_options().
DecidingValues deciding_values(DecidingValues options,
                               const std::map<std::string, std::string>& input_sha256);

/// Whether anything has the name of a manifest, be it a link to nowhere or to itself.
bool has_progress_manifest(const std::filesystem::path& path);

/// Reads the manifest of unfinished work: `take` gets it when it says that it is of this format and
/// version, and may take values out of it as if all were there. FileError that says what to do when
/// it is not a regular file, larger than any manifest, damaged or of another format.
void read_progress_manifest(const std::filesystem::path& path,
                            const std::string& format,
                            int version,
                            const std::function<void(const nlohmann::json&)>& take);

/// InputError that names every difference between what earlier work in `folder` was begun with and
/// what is asked for now.
void require_same(const DecidingValues& earlier,
                  const DecidingValues& now,
                  const std::filesystem::path& folder);

}  // namespace af
