// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/compare_methods.h"

#include <iostream>

#include "base/error.h"
#include "evaluate/outputs/table_paths.h"
#include "evaluate/registration/method_comparison.h"
#include "evaluate/registration/pose_distances.h"
#include "files/output_file.h"

namespace af::evaluation {

void CompareOptions::describe(Fields& field) {
  field("runs", runs, "Folders of finished runs; all their subfolders are searched, too")
      .as("RUN")
      .required();
  field("output", output, "Markdown file to write; a CSV of the same name is written beside it")
      .as("-o,--output");
  field("screen", is_screen, "In Markdown, measures against optimisers instead of a row per run");
  field("pose_distances",
        with_pose_distances,
        "Also the distance between the end poses of every two methods from the same starts (mean "
        "over the target box: median, 95th percentile, maximum) and the rotation between them for "
        "every patient, and the mean distance over patients with intervals, as further tables and "
        "as CSVs, ...-pose-distances.csv and ...-pose-distances-over-patients.csv");
  field("equivalence_margin_mm",
        equivalence_margin_mm,
        "With --pose-distances: two methods count as equivalent when their ends lie closer "
        "together than this on average over patients, mm")
      .above(0.0)
      .finite();
}

namespace {

void run_compare(const CompareOptions& options,
                 const std::string& /*command_line*/,
                 const Communicator& world) {
  all_or_none(world, [&] {
    if (!world.is_root()) return;
    throw_if_any(table_problems(options.output));
    const std::filesystem::path csv = csv_beside(options.output);
    announce_output(csv);
    announce_output(options.output);
    std::filesystem::path distances_csv = csv;
    distances_csv.replace_filename(csv.stem().string() + "-pose-distances.csv");
    std::filesystem::path patients_csv = csv;
    patients_csv.replace_filename(csv.stem().string() + "-pose-distances-over-patients.csv");
    if (options.with_pose_distances) {
      announce_output(distances_csv);
      announce_output(patients_csv);
    }
    const std::vector<EvaluationRun> runs = find_runs(options.runs);
    const std::vector<MethodRow> rows = method_rows(runs);
    if (rows.empty())
      throw InputError("RUN", options.runs.front().string(), "holds no finished registration run");
    std::vector<std::string> parts = {options.is_screen ? screen_markdown(rows)
                                                        : methods_markdown(rows)};
    std::string text;
    if (!options.is_screen) parts.push_back(studies_markdown(rows));
    parts.push_back(pairs_markdown(runs));
    const std::vector<PoseDistanceRow> distances =
        options.with_pose_distances ? pose_distances(runs) : std::vector<PoseDistanceRow>();
    parts.push_back(pose_distances_markdown(distances));
    const std::vector<PatientDistances> over_patients =
        distances_over_patients(distances, options.equivalence_margin_mm);
    parts.push_back(patient_distances_markdown(over_patients));
    for (const std::string& part : parts)
      if (!part.empty()) text += (text.empty() ? "" : "\n") + part;
    if (options.with_pose_distances) {
      write_text_file(distances_csv, pose_distances_table(distances).to_text());
      write_text_file(patients_csv, patient_distances_table(over_patients).to_text());
    }
    write_text_file(csv, methods_table(rows).to_text());
    write_text_file(options.output, text);
    std::cout << text;
  });
}

}  // namespace

cli::SubCommand compare_command(CLI::App& app) {
  return cli::sub_command(
      app,
      "compare",
      "One table of finished registration runs: success for starts 0-8, 8-16 and 16-30 mm from "
      "gold, TRE, bias, DRRs and seconds, and field against ray casting, as Markdown and CSV",
      run_compare);
}

}  // namespace af::evaluation
