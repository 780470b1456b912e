// SPDX-License-Identifier: Apache-2.0
#include "tools/inspect/inspect_run.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "base/error.h"
#include "ranks/root_only.h"
#include "study/study_template.h"
#include "tools/inspect/inspection.h"

namespace af {
namespace {

/// Prints the report of each path as soon as it is known. JSON is one array.
void print(const InspectOptions& options, const std::vector<Inspection>& inspections) {
  if (!options.as_json) {
    for (const Inspection& inspection : inspections) std::cout << to_text(inspection);
    return;
  }
  auto array = nlohmann::ordered_json::array();
  for (const Inspection& inspection : inspections) array.push_back(to_json(inspection));
  // File headers may hold text of any encoding.
  std::cout << array.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
}

}  // namespace

void InspectOptions::describe(Fields& field) {
  field("paths", paths, "Files, folders or names of shipped rigs").as("PATH").one_of_group("What");
  field(
      "template",
      template_name,
      "Print a file to fill in, every key with a comment: af-inspect --template study > study.toml")
      .choice(template_names())
      .one_of_group("What");
  field("json", as_json, "Print one JSON array instead of text");
  field("list_views",
        lists_views,
        "For scripts: print one line per view of a study: case, camera, and where the gold pose is "
        "from (fiducials, study or none), with tabs between them")
      .excludes({"--json"});
  field("list_inputs",
        lists_inputs,
        "For scripts: print one line per case and file that a study reads, with a tab between them")
      .excludes({"--json", "--list-views"});
  field("pictures",
        pictures,
        "Folder for pictures of a study's views, room and CT, or of a CT with its coordinates in "
        "mm (LPS)")
      .excludes({"--json", "--list-views", "--list-inputs"});
  field.part(ct);
  field.at("series").help =
      "SeriesInstanceUID to read from a DICOM folder that holds several series";
}

void run_inspect(const InspectOptions& options, const Communicator& world) {
  if (!options.template_name.empty()) {
    if (world.is_root()) std::cout << template_text(options.template_name);
    return;
  }
  if (options.lists_views || options.lists_inputs) {
    for (const std::string& path : options.paths) {
      const std::string lines = all_or_none(
          world, [&] { return options.lists_views ? view_lines(path) : input_lines(path); });
      if (world.is_root()) std::cout << lines;
    }
    return;
  }
  if (!options.pictures.empty()) {
    for (const std::string& path : options.paths) {
      do_on_root(world, [&] {
        const DrawnPictures drawn = draw_pictures(path, options.ct, options.pictures);
        std::cout << drawn.text << std::flush;
        throw_if_any(drawn.problems);
      });
    }
    return;
  }
  std::vector<Inspection> inspections;
  ExitCode worst = ExitCode::Done;
  std::size_t bad = 0;
  for (const std::string& path : options.paths) {
    inspections.push_back(inspect_path(path, options.ct, world));
    const ExitCode code = worst_exit_code(inspections.back());
    worst = std::max(worst, code);
    bad += code == ExitCode::Done ? 0 : 1;
  }
  if (world.is_root()) print(options, inspections);
  if (worst == ExitCode::Done) return;
  std::cout.flush();
  // Every rank knows the same, but only one says it.
  throw RemoteError(worst,
                    std::to_string(bad) + " of " + std::to_string(options.paths.size()) +
                        " paths not usable; the reasons are in the report");
}

}  // namespace af
