// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/evaluation_run.h"

#include <algorithm>
#include <set>
#include <tuple>

#include "base/error.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "files/output_file.h"
#include "text/json_text.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr const char* kFormat = "attenuation-fields evaluation";
constexpr int kVersion = 1;

/// Folders with a summary.json, the given one and those below it.
void collect(const std::filesystem::path& folder, std::set<std::filesystem::path>& found) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error))
    throw FileError(folder.string(), "is not a folder of results");
  try {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(
             folder, std::filesystem::directory_options::skip_permission_denied))
      if (entry.path().filename() == "summary.json" && entry.is_regular_file(error))
        found.insert(std::filesystem::weakly_canonical(entry.path().parent_path()));
  } catch (const std::filesystem::filesystem_error& error_of_walk) {
    throw FileError(folder.string(), error_of_walk.what());
  }
}

/// Whether a relative path stays below its base folder.
bool leads_down(const std::filesystem::path& relative) {
  const std::filesystem::path path = relative.lexically_normal();
  return !path.empty() && !path.is_absolute() && *path.begin() != ".." &&
         path.native().find('\0') == std::string::npos;
}

/// The paths below the deepest folder that all runs share. Where several registration runs end
/// alike ("skull/registration", "thorax/registration"), the common end is left out.
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
  if (registrations < 2 || ends.size() != 1 || ends.begin()->empty()) return;
  for (EvaluationRun& run : runs)
    if (run.kind == "registration")
      run.name = std::filesystem::path(run.name).parent_path().generic_string();
}

}  // namespace

std::filesystem::path EvaluationRun::path_of(const std::string& relative) const {
  std::error_code error;
  std::filesystem::path path = std::filesystem::weakly_canonical(folder / relative, error);
  if (error) throw FileError((folder / relative).string(), error.message());
  const std::filesystem::path own = std::filesystem::weakly_canonical(folder, error);
  if (error || !leads_down(relative) || !leads_down(path.lexically_relative(own)))
    throw FileError((folder / "summary.json").string(),
                    "names '" + relative + "', which is not a file of the run");
  return path;
}

bool EvaluationRun::has_file(const std::string& relative) const {
  std::error_code error;
  return std::filesystem::is_regular_file(path_of(relative), error);
}

std::string EvaluationRun::file(const std::string& file_name) const {
  const std::filesystem::path path(file_name);
  if (path.filename() != path)
    throw FileError((folder / "summary.json").string(),
                    "names '" + file_name + "', which is not a file of the run");
  return read_text_file(existing(file_name));
}

CsvTable EvaluationRun::table(const std::string& relative) const {
  return CsvTable::read(existing(relative));
}

void EvaluationRun::read_in_parts(const std::string& relative,
                                  const std::function<void(const CsvTable& part)>& receive) const {
  CsvTable::read_in_parts(existing(relative), receive);
}

std::filesystem::path EvaluationRun::existing(const std::string& relative) const {
  if (!has_file(relative)) throw FileError((folder / relative).string(), "is missing, or no file");
  return path_of(relative);
}

std::string EvaluationRun::link(const std::string& relative) const {
  if (!leads_down(relative))
    throw FileError((folder / "summary.json").string(),
                    "names '" + relative + "', which is not in the run's folder");
  return url_of((folder.lexically_proximate(page_folder) / relative).generic_string());
}

std::vector<EvaluationRun> find_runs(const std::vector<std::filesystem::path>& folders) {
  std::set<std::filesystem::path> paths;
  std::set<std::filesystem::path> named;
  for (const std::filesystem::path& folder : folders) {
    collect(folder, paths);
    named.insert(std::filesystem::weakly_canonical(folder));
  }
  std::vector<EvaluationRun> runs;
  for (const std::filesystem::path& path_of_run : paths) {
    EvaluationRun run;
    run.folder = path_of_run;
    const std::filesystem::path path = run.folder / "summary.json";
    run.summary = json_of_text(run.file("summary.json"), path.string());
    if (!run.summary.is_object()) throw FileError(path.string(), "is no JSON object");
    // Other programs may leave a summary.json, too.
    if (run.summary.value("format", json()) != kFormat) continue;
    if (run.summary.value("format_version", json()) != kVersion)
      throw FileError(path.string(),
                      "format_version",
                      std::to_string(kVersion),
                      plain(run.summary.value("format_version", json())));
    const json kind = run.summary.value("kind", json());
    if (kind != "image-quality" && kind != "registration" && kind != "similarity-curves" &&
        kind != "field-parameters" && kind != "error-budget")
      throw FileError(
          path.string(),
          "kind",
          "image-quality, registration, similarity-curves, field-parameters or error-budget",
          kind.is_string() ? kind.get<std::string>() : "no text");
    run.kind = kind.get<std::string>();
    // When its own folder was named, the repeat of a start is a run like any other.
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
