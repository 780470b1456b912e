// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/compare_methods.h"

#include "base/error.h"
#include "evaluate/registration/method_comparison.h"
#include "evaluate/registration/pose_distances.h"
#include "evaluate/report/report_program.h"
#include "evaluate/report/table_paths.h"
#include "files/output_file.h"
#include "ranks/root_only.h"

namespace af::evaluation {

void CompareOptions::describe(Fields& field) {
  field("runs", runs, "Folders of finished runs; all their subfolders are searched, too")
      .as("RUN")
      .required();
  field("output",
        output,
        "Markdown file to write, by af-report; CSVs of the same name are written beside it")
      .as("-o,--output");
  field("screen", is_screen, "In Markdown, measures against optimisers instead of a row per run");
  field("pose_distances",
        with_pose_distances,
        "Also tables of how far the ends of every two methods from the same starts lie apart, per "
        "patient and over patients");
  field("equivalence_margin_mm",
        equivalence_margin_mm,
        "With --pose-distances: methods are equivalent when their ends are this near on average "
        "over patients, mm")
      .above(0.0)
      .finite();
}

namespace {

void run_compare(const CompareOptions& options,
                 const std::string& /*command_line*/,
                 const Communicator& world) {
  do_on_root(world, [&] {
    throw_if_any(table_problems(options.output));
    const std::filesystem::path csv = csv_beside(options.output);
    const auto beside = [&](const std::string& what) {
      return csv.parent_path() / (csv.stem().string() + "-" + what + ".csv");
    };
    const std::filesystem::path pairs_csv = beside("pairs");
    const std::filesystem::path distances_csv = beside("pose-distances");
    const std::filesystem::path patients_csv = beside("pose-distances-over-patients");
    for (const std::filesystem::path& path :
         {csv, options.output, pairs_csv, distances_csv, patients_csv})
      announce_output(path);
    const std::vector<EvaluationRun> runs = find_runs(options.runs);
    const CsvTable methods = methods_table(runs);
    const CsvTable pairs = pairs_table(runs);
    // Those of an earlier comparison would end up in the Markdown.
    for (const std::filesystem::path& path : {pairs_csv, distances_csv, patients_csv})
      remove_output(path);
    if (pairs.row_count() > 0) write_text_file(pairs_csv, pairs.to_text());
    if (options.with_pose_distances) {
      const std::vector<PoseDistanceRow> distances = pose_distances(runs);
      write_text_file(distances_csv, pose_distances_table(distances).to_text());
      write_text_file(
          patients_csv,
          patient_distances_table(distances_over_patients(distances, options.equivalence_margin_mm))
              .to_text());
    }
    write_text_file(csv, methods.to_text());
    std::vector<std::string> arguments = {csv.string()};
    if (options.is_screen) arguments.emplace_back("--screen");
    draw_results(arguments, world);
  });
}

}  // namespace

cli::SubCommand compare_command(CLI::App& app) {
  return cli::sub_command(app,
                          "compare",
                          "One table of finished registration runs: success by distance of the "
                          "start, TRE, bias, DRRs and seconds, as Markdown and CSV",
                          run_compare);
}

}  // namespace af::evaluation
