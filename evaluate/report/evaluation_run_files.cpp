// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/evaluation_run_files.h"

#include <algorithm>
#include <set>
#include <tuple>

#include "base/error.h"
#include "evaluate/report/html_text.h"
#include "io/output_file.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr const char* kFormat = "attenuation-fields evaluation";
constexpr int kVersion = 1;

/// summary.json files in a folder and below, a run's own unfinished folders left out.
void collect(const std::filesystem::path& folder, std::set<std::filesystem::path>& found) {
  if (!std::filesystem::is_directory(folder))
    throw FileError(folder.string(), "is not a folder of results");
  for (const auto& entry : std::filesystem::recursive_directory_iterator(
           folder, std::filesystem::directory_options::skip_permission_denied))
    if (entry.path().filename() == "summary.json" && entry.is_regular_file())
      found.insert(std::filesystem::weakly_canonical(entry.path()));
}

/// The paths below the deepest folder that all runs share. Where several registration runs end
/// alike ("skull/registration", "thorax/registration") the end tells nothing and is left out.
void set_names(std::vector<EvaluationRun>& runs) {
  std::filesystem::path shared = runs.front().folder.parent_path();
  for (const EvaluationRun& run : runs)
    while (run.folder == shared || *run.folder.lexically_relative(shared).begin() == "..")
      shared = shared.parent_path();
  std::set<std::filesystem::path> ends;
  std::size_t registrations = 0;
  for (EvaluationRun& run : runs) {
    const std::filesystem::path name = run.folder.lexically_relative(shared);
    run.name = name.generic_string();
    if (run.kind != "registration") continue;
    ++registrations;
    ends.insert(name.has_parent_path() ? name.filename() : std::filesystem::path());
  }
  if (registrations < 2 || ends.size() != 1) return;
  for (EvaluationRun& run : runs)
    if (run.kind == "registration")
      run.name = std::filesystem::path(run.name).parent_path().generic_string();
}

}  // namespace

std::string EvaluationRun::file(const std::string& file_name) const {
  const std::filesystem::path path(file_name);
  if (file_name.empty() || path.filename() != path || file_name == "." || file_name == "..")
    throw FileError((folder / "summary.json").string(),
                    "names '" + file_name + "', which is not a file of the run");
  return read_text_file(folder / path);
}

std::string EvaluationRun::link(const std::string& file_name) const {
  return url_of((folder.lexically_proximate(page_folder) / file_name).generic_string());
}

std::vector<EvaluationRun> find_runs(const std::vector<std::filesystem::path>& folders) {
  std::set<std::filesystem::path> paths;
  std::set<std::filesystem::path> named;
  for (const std::filesystem::path& folder : folders) {
    collect(folder, paths);
    named.insert(std::filesystem::weakly_canonical(folder));
  }
  std::vector<EvaluationRun> runs;
  for (const std::filesystem::path& path : paths) {
    EvaluationRun run;
    run.folder = path.parent_path();
    run.summary = json::parse(read_text_file(path), nullptr, false);
    if (!run.summary.is_object()) throw FileError(path.string(), "is not JSON");
    // Other programs may leave a summary.json, too.
    if (run.summary.value("format", json()) != kFormat) continue;
    if (run.summary.value("format_version", json()) != kVersion)
      throw FileError(path.string(),
                      "format_version",
                      std::to_string(kVersion),
                      run.summary.value("format_version", json()).dump());
    const json kind = run.summary.value("kind", json());
    if (kind != "image-quality" && kind != "registration" && kind != "similarity-curves" &&
        kind != "field-parameters" && kind != "error-budget")
      throw FileError(
          path.string(),
          "kind",
          "image-quality, registration, similarity-curves, field-parameters or error-budget",
          kind.dump());
    run.kind = kind.get<std::string>();
    // Asked for by its own folder, the repeat of a start is a run like others.
    if (run.summary.contains("only_start") && !named.contains(run.folder)) continue;
    runs.push_back(std::move(run));
  }
  if (runs.empty())
    throw InputError("RUN", folders.front().string(), "holds no finished run of af-evaluate");
  std::sort(runs.begin(), runs.end(), [](const EvaluationRun& a, const EvaluationRun& b) {
    return std::tie(b.kind, a.folder) < std::tie(a.kind, b.folder);
  });
  set_names(runs);
  return runs;
}

}  // namespace af::evaluation
