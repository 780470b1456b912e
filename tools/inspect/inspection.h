// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "ct/ct_reader.h"
#include "ranks/communicator.h"

namespace af {

/// What af-inspect found out about one path.
struct Inspection {
  std::string path;
  std::string kind = "unknown";  ///< "CT", "X-ray", "rig", "study", "field", "pose", ...
  nlohmann::ordered_json facts = nlohmann::ordered_json::object();
  std::vector<std::string> warnings;  ///< readable, but probably not what was meant
  std::string error;                  ///< why it is not usable; empty when it is
  ExitCode exit_code = ExitCode::Done;
  std::vector<Inspection> items;  ///< the known files of a folder
};

/// Collective. Recognises a path by content and checks it completely (fields: every checksum).
/// Problems of the file are in the result, never exceptions.
Inspection inspect_path(const std::filesystem::path& path,
                        const CtReadOptions& options,
                        const Communicator& communicator);

/// The worst exit code of an inspection and its items.
ExitCode worst_exit_code(const Inspection& inspection);

/// {path, kind, ok, exit_code, error?, warnings, facts..., items?}.
nlohmann::ordered_json to_json(const Inspection& inspection);

/// For people: one fact per line.
std::string to_text(const Inspection& inspection);

/// What was drawn, for people, and which of it cannot be right.
struct DrawnPictures {
  std::string text;
  std::vector<std::string> problems;
};

/// Draws the pictures of every case of a study (draw_study_pictures()), or of a CT
/// (draw_ct_pictures()), into a folder, which is created. Throws as read_study() and reading what
/// the study names do, or as read_ct() does.
DrawnPictures draw_pictures(const std::filesystem::path& study_or_ct,
                            const CtReadOptions& ct_reading,
                            const std::filesystem::path& folder);

/// For scripts: one line per view of a study, "case<tab>camera<tab>gold", where gold is
/// gold_source(). Throws as read_study() does.
std::string view_lines(const std::filesystem::path& study_path);

/// For scripts: a line "case<tab>path" for every file that a study's cases read: CT, rig (unless it
/// is shipped), X-rays, masks. Throws FileError and InputError as read_study() does.
std::string input_lines(const std::filesystem::path& study_path);

}  // namespace af
