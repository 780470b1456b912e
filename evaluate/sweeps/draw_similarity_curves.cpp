// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/draw_similarity_curves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <limits>
#include <optional>
#include <tuple>

#include "base/error.h"
#include "evaluate/registration/loaded_methods.h"
#include "evaluate/report/evaluation_run.h"
#include "evaluate/report/report_program.h"
#include "evaluate/report/row_gathering.h"
#include "evaluate/report/sample_summary_json.h"
#include "evaluate/sweeps/similarity_curve.h"
#include "files/csv_cells.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "files/sha256.h"
#include "geometry/target_box.h"
#include "ranks/root_only.h"
#include "ranks/run_folder.h"
#include "study/case_gold_standard.h"
#include "study/shared_inputs.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

constexpr std::array<const char*, kPoseParameters> kAxisNames = {
    "rx", "ry", "rz", "tx", "ty", "tz"};

const char* unit_of(int axis) {
  return axis < 3 ? "deg" : "mm";
}

/// Similarity along one axis by one renderer.
struct Curve {
  std::string renderer;
  int axis = 0;
  std::vector<double> offsets;
  std::vector<double> similarity;  ///< NaN: outside the field
  CurvePeak peak;
};

std::vector<Curve> empty_curves(const SimilarityCurvesOptions& options) {
  std::vector<Curve> curves;
  for (const std::string& renderer : options.chosen_renderers())
    for (int axis = 0; axis < kPoseParameters; ++axis) {
      Curve curve{renderer, axis, {}, {}, {}};
      curve.offsets = axis < 3 ? curve_offsets(options.half_width_deg, options.curve_step_deg)
                               : curve_offsets(options.half_width_mm, options.curve_step_mm);
      curve.similarity.resize(curve.offsets.size());
      curves.push_back(std::move(curve));
    }
  return curves;
}

/// Collective. Fills the curves on rank 0. Methods come one after the other, so that blocks of the
/// work queue hold work of one duration.
void measure_curves(std::vector<LoadedMethod>& methods,
                    const PoseFrame& gold_frame,
                    const RunFolder& run,
                    const DecidingValues& decides,
                    const Communicator& world,
                    std::vector<Curve>& curves) {
  for (LoadedMethod& method : methods) {
    std::vector<std::pair<std::size_t, std::size_t>> items;
    for (std::size_t c = 0; c < curves.size(); ++c)
      for (std::size_t i = 0; curves[c].renderer == method.renderer && i < curves[c].offsets.size();
           ++i)
        items.emplace_back(c, i);
    announce_time(
        world, method.renderer + " similarities", static_cast<std::int64_t>(items.size()), [&] {
          std::ignore =
              method.registration.similarity_at(pose_from_parameters(gold_frame, PoseParameters()));
          return 1.0;
        });
    const std::vector<double> similarities = collected_rows<double>(
        world,
        run.unfinished(method.renderer, decides),
        static_cast<std::int64_t>(items.size()),
        method.renderer + " similarities",
        [&](std::int64_t item) {
          const auto [c, i] = items[static_cast<std::size_t>(item)];
          const RigidTransform pose =
              pose_from_parameters(gold_frame, along_axis(curves[c].axis, curves[c].offsets[i]));
          const registration::ObjectiveValue value = method.registration.similarity_at(pose);
          return value.is_admissible ? value.similarity : std::numeric_limits<double>::quiet_NaN();
        });
    for (std::size_t k = 0; k < items.size(); ++k)
      curves[items[k].first].similarity[items[k].second] = similarities[k];
  }
}

/// The level from which widths are measured: the lowest similarity of any curve of the renderer, so
/// that axes can be compared.
double base_of(const std::vector<Curve>& curves, const std::string& renderer) {
  double base = std::numeric_limits<double>::infinity();
  for (const Curve& curve : curves)
    if (curve.renderer == renderer)
      for (const double value : curve.similarity)
        if (value < base) base = value;
  return base;
}

void find_peaks(std::vector<Curve>& curves) {
  for (Curve& curve : curves)
    curve.peak = find_peak(curve.offsets, curve.similarity, base_of(curves, curve.renderer));
}

/// The first columns of both tables.
CsvCells axis_cells(const Curve& curve) {
  return {{"renderer", curve.renderer},
          {"parameter", kAxisNames[static_cast<std::size_t>(curve.axis)]},
          {"unit", unit_of(curve.axis)}};
}

CsvTable curves_table(const std::vector<Curve>& curves) {
  std::vector<CsvCells> rows;
  for (const Curve& curve : curves)
    for (std::size_t i = 0; i < curve.offsets.size(); ++i) {
      rows.push_back(axis_cells(curve));
      append({{"offset", curve.offsets[i]}, {"similarity", curve.similarity[i]}}, rows.back());
    }
  return csv_table(std::move(rows));
}

/// Width in mm. For angles, it is that at the target box's RMS radius about the centre of rotation.
double width_mm(const Curve& curve, double radius_mm) {
  return curve.axis < 3 ? curve.peak.width * kRadPerDeg * radius_mm : curve.peak.width;
}

CsvTable maxima_table(const std::vector<Curve>& curves, double radius_mm) {
  return csv_table(curves, [&](const Curve& curve) {
    CsvCells cells = axis_cells(curve);
    append({{"offset_of_maximum", curve.peak.offset},
            {"similarity_at_maximum", curve.peak.similarity},
            {"at_edge", curve.peak.is_at_edge},
            {"width", curve.peak.width},
            {"width_mm_at_target", width_mm(curve, radius_mm)}},
           cells);
    return cells;
  });
}

/// The axis of the widest peak. A width that leaves the window counts as widest. When two or more
/// leave it, the result is empty.
std::string broadest_axis(const std::vector<Curve>& curves,
                          const std::string& renderer,
                          double radius_mm,
                          int first_axis,
                          int last_axis) {
  std::string broadest;
  double widest_mm = -1.0;
  for (const Curve& curve : curves) {
    if (curve.renderer != renderer || curve.axis < first_axis || curve.axis > last_axis) continue;
    const double width = width_mm(curve, radius_mm);
    const double rank = std::isfinite(width) ? width : std::numeric_limits<double>::infinity();
    if (rank > widest_mm) {
      widest_mm = rank;
      broadest = kAxisNames[static_cast<std::size_t>(curve.axis)];
    } else if (rank == widest_mm) {
      broadest.clear();
    }
  }
  return broadest;
}

json renderer_json(const std::vector<Curve>& curves,
                   const std::string& renderer,
                   double radius_mm) {
  json maxima = json::array();
  for (const Curve& curve : curves)
    if (curve.renderer == renderer)
      maxima.push_back({{"parameter", kAxisNames[static_cast<std::size_t>(curve.axis)]},
                        {"unit", unit_of(curve.axis)},
                        {"offset", curve.peak.offset},
                        {"similarity", curve.peak.similarity},
                        {"is_at_edge", curve.peak.is_at_edge},
                        {"width", number_json(curve.peak.width)},
                        {"width_mm_at_target", number_json(width_mm(curve, radius_mm))}});
  return {{"renderer", renderer},
          {"maxima", maxima},
          {"broadest_rotation", broadest_axis(curves, renderer, radius_mm, 0, 2)},
          {"broadest_translation", broadest_axis(curves, renderer, radius_mm, 3, 5)}};
}

void print_maxima(const std::vector<Curve>& curves, const json& renderers) {
  for (const json& renderer : renderers) {
    const std::string name = renderer["renderer"].get<std::string>();
    std::cout << name << ": maxima at";
    for (const Curve& curve : curves)
      if (curve.renderer == name)
        std::cout << ' ' << kAxisNames[static_cast<std::size_t>(curve.axis)] << ' '
                  << fixed_text(curve.peak.offset, 2) << ' ' << unit_of(curve.axis)
                  << (curve.axis == kPoseParameters - 1 ? "" : ",");
    std::cout << "; broadest rotation " << renderer["broadest_rotation"].get<std::string>()
              << ", translation " << renderer["broadest_translation"].get<std::string>() << '\n';
  }
}

}  // namespace

std::vector<std::string> problems(const SimilarityCurvesOptions& options) {
  std::vector<std::string> found = field_problems(options);
  append_problems(options, found);
  const auto require_curve = [&](const char* unit, double half_width, double step) {
    constexpr double kMostSteps = 100000;
    if (!(half_width > 0.0) || !(step > 0.0) || !(step <= half_width) ||
        !(half_width / step <= kMostSteps))
      found.push_back(std::string("--curve-step-") + unit + " = " + number_text(step) +
                      ": must be positive, at most --half-width-" + unit + " = " +
                      number_text(half_width) + " and at least a 100000th of it");
  };
  require_curve("mm", options.half_width_mm, options.curve_step_mm);
  require_curve("deg", options.half_width_deg, options.curve_step_deg);
  return found;
}

void SimilarityCurvesOptions::describe(Fields& field) {
  field.part<MethodOptions>(*this);
  field("case", case_name, "Case of the study (default: its only one)");
  field("half_width_mm", half_width_mm, "Largest translation to either side, mm");
  field("half_width_deg", half_width_deg, "Largest rotation to either side, degrees");
  field("curve_step_mm", curve_step_mm, "Step of translations, mm");
  field("curve_step_deg", curve_step_deg, "Step of rotations, degrees");
  field.part(resume);
  field("output", output_folder, "Folder for the results")
      .as("-o,--output")
      .required()
      .not_deciding("results are the same");
}

SimilarityCurvesOptions SimilarityCurvesOptions::in_force() const {
  SimilarityCurvesOptions options = *this;
  options.method = method.in_force();
  return options;
}

namespace {

void run_similarity_curves(const SimilarityCurvesOptions& options,
                           const std::string& command_line,
                           const Communicator& world) {
  const std::filesystem::path& folder = options.output_folder;
  all_or_none(world, [&] { throw_if_any(problems(options)); });
  RunFolder run({folder,
                 {"similarity-curves.csv", "maxima.csv", "reproduce.sh", "summary.json"},
                 options.resume.restarts},
                world);
  run.open();
  const Shared<Study> study = shared_study(options.study, world);
  const StudyCase study_case =
      all_or_none(world, [&] { return study->find_case(options.case_name); });
  const GoldStandard gold =
      all_or_none(world, [&] { return gold_standard(study, study_case, options.gold); });
  SimilarityCurvesOptions in_force = all_or_none(world, [&] { return options.in_force(); });
  in_force.case_name = study_case.name;
  Provenance provenance = {
      "af-evaluate similarity-curves", command_line, to_toml(in_force), 0, world.size(), {}};
  LoadedInputs inputs;
  std::vector<LoadedMethod> methods = load_methods(options, {}, study, study_case, world, inputs);
  provenance.inputs = inputs.identities;
  provenance.input_notes = inputs.notes;
  do_on_root(world, [&] { provenance.inputs["study"] = sha256_of_file(study->path.string()); });
  std::vector<Curve> curves = empty_curves(options);
  measure_curves(methods,
                 PoseFrame::about(gold.room_from_ct, study_case.center_ct_mm),
                 run,
                 deciding_values(deciding_options(in_force), provenance.inputs),
                 world,
                 curves);
  do_on_root(world, [&] {
    find_peaks(curves);
    const double radius_mm = rms_radius_mm(study_case.target_box_ct, study_case.center_ct_mm);
    run.begin_results();
    write_text_file(folder / "similarity-curves.csv", curves_table(curves).to_text());
    write_text_file(folder / "maxima.csv", maxima_table(curves, radius_mm).to_text());
    json summary = summary_of_kind("similarity-curves");
    summary["case"] = study_case.name;
    summary["gold"] = to_json(gold);
    summary["similarity"] = methods.front().registration.method.final_similarity();
    summary["rms_radius_mm"] = radius_mm;
    summary["figures"] = {"similarity-curves"};
    summary["renderers"] = json::array();
    for (const std::string& renderer : options.chosen_renderers())
      summary["renderers"].push_back(renderer_json(curves, renderer, radius_mm));
    run.finish(summary, provenance);
    print_maxima(curves, summary["renderers"]);
    draw_results({folder.string()}, world);
    std::cout << "results: " << folder.string() << '\n';
  });
}

}  // namespace

cli::SubCommand similarity_curves_command(CLI::App& app) {
  auto options = std::make_shared<SimilarityCurvesOptions>();
  options->renderer = "both";
  options->method.preset = "paper";
  cli::SubCommand command = cli::sub_command(app,
                                             "similarity-curves",
                                             "Similarity along each of the six pose parameters "
                                             "about the gold pose, by field and by ray casting",
                                             run_similarity_curves,
                                             options);
  cli::bind_run_limits(*command.app);
  return command;
}

}  // namespace af::evaluation
