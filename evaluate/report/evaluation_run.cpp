// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/evaluation_run.h"

#include <set>

#include "base/error.h"
#include "files/json_text.h"
#include "files/output_file.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr const char* kFormat = "attenuation-fields evaluation";
constexpr int kVersion = 1;

/// Collects folders with a summary.json: the given one and those below it.
void collect(const std::filesystem::path& folder, std::set<std::filesystem::path>& found) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error))
    throw FileError(folder.string(), "is not a folder of results");
  try {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(
             folder, std::filesystem::directory_options::skip_permission_denied))
      if (entry.path().filename() == "summary.json" && !entry.is_symlink() &&
          entry.is_regular_file(error))
        found.insert(std::filesystem::weakly_canonical(entry.path().parent_path()));
  } catch (const std::filesystem::filesystem_error& error_of_walk) {
    throw FileError(folder.string(), error_of_walk.what());
  }
}

}  // namespace

json summary_of_kind(const std::string& kind) {
  return {{"format", kFormat}, {"format_version", kVersion}, {"kind", kind}};
}

void EvaluationRun::read_registrations(
    const std::function<void(const CsvTable& part)>& receive) const {
  const std::filesystem::path path = folder / "registrations.csv";
  std::error_code error;
  if (!std::filesystem::is_regular_file(std::filesystem::symlink_status(path, error)))
    throw FileError(path.string(), "is missing, or no file");
  CsvTable::read_in_parts(path, receive);
}

std::vector<EvaluationRun> find_runs(const std::vector<std::filesystem::path>& folders) {
  std::set<std::filesystem::path> paths;
  std::set<std::filesystem::path> named;
  for (const std::filesystem::path& folder : folders) {
    collect(folder, paths);
    named.insert(std::filesystem::weakly_canonical(folder));
  }
  std::vector<EvaluationRun> runs;
  for (const std::filesystem::path& folder : paths) {
    const std::filesystem::path path = folder / "summary.json";
    EvaluationRun run{folder, json_of_text(read_text_file(path), path.string())};
    if (!run.summary.is_object()) throw FileError(path.string(), "is no JSON object");
    // Other programs may leave a summary.json too.
    if (run.summary.value("format", json()) != kFormat) continue;
    const json version = run.summary.value("format_version", json());
    if (version != kVersion)
      throw FileError(path.string(), "format_version", std::to_string(kVersion), version.dump());
    if (run.summary.value("kind", json()) != "registration") continue;
    // The repeat of a start counts as a run like any other only when its own folder was named.
    if (run.summary.contains("only_start") && !named.contains(folder)) continue;
    runs.push_back(std::move(run));
  }
  if (runs.empty())
    throw InputError(
        "RUN", folders.front().string(), "holds no finished run of af-evaluate registration");
  return runs;
}

}  // namespace af::evaluation
