// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/evaluation_run_files.h"

#include <algorithm>
#include <set>
#include <tuple>

#include "base/error.h"
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

}  // namespace

std::string EvaluationRun::file(const std::string& name) const {
  const std::filesystem::path path(name);
  if (name.empty() || path.filename() != path || name == "." || name == "..")
    throw FileError((folder / "summary.json").string(),
                    "names '" + name + "', which is not a file of the run");
  return read_text_file(folder / path);
}

std::vector<EvaluationRun> find_runs(const std::vector<std::filesystem::path>& folders) {
  std::set<std::filesystem::path> paths;
  for (const std::filesystem::path& folder : folders) collect(folder, paths);
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
    runs.push_back(std::move(run));
  }
  if (runs.empty())
    throw InputError("RUN", folders.front().string(), "holds no finished run of af-evaluate");
  std::sort(runs.begin(), runs.end(), [](const EvaluationRun& a, const EvaluationRun& b) {
    return std::tie(b.kind, a.folder) < std::tie(a.kind, b.folder);
  });
  return runs;
}

}  // namespace af::evaluation
