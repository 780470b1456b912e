// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/measure_lattice_errors.h"

#include <algorithm>
#include <array>
#include <iostream>
#include <limits>
#include <map>
#include <memory>

#include "base/error.h"
#include "base/sample_summary.h"
#include "base/thread_pool.h"
#include "drr/drr_renderer.h"
#include "evaluate/registration/loaded_methods.h"
#include "evaluate/report/table_paths.h"
#include "evaluate/sweeps/lattice_errors.h"
#include "field/field_reading.h"
#include "files/csv_cells.h"
#include "files/output_file.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "ranks/progress_printer.h"
#include "ranks/root_only.h"
#include "study/case_gold_standard.h"
#include "study/shared_inputs.h"

namespace af::evaluation {
namespace {

/// Every start lies this far from its true pose, about 1 mm over a target of 60 mm.
constexpr std::array<double, 6> kStartDegAndMm = {0.3, -0.3, 0.3, 0.6, -0.5, 0.6};

/// The ends of one renderer, in the order of the poses.
struct LatticeEnds {
  std::string renderer;
  std::vector<std::array<double, 6>>
      errors;                       ///< from truth to end, deg and mm; NaN: did not converge
  std::vector<double> distance_mm;  ///< mean over the target box, for those that converged
};

/// Collective. The cells of the fields of a case.
std::vector<CellView> cells_of(const Study& study,
                               const StudyCase& study_case,
                               const LatticeErrorsOptions& options,
                               const Communicator& world) {
  const std::map<std::string, std::filesystem::path> given = options.fields.by_camera();
  std::vector<CellView> views;
  for (const StudyView& view : study_case.views) {
    const auto path = given.find(view.camera);
    const auto field = read_field(path != given.end() ? path->second : *view.field, world);
    const LightSlab& planes = field->light_slab;
    // The (s,t) nodes of several slabs are about equally far apart, so their mean is taken.
    double s_mm = 0.0;
    double t_mm = 0.0;
    for (const SlabGeometry& slab : planes.slabs) {
      s_mm += slab.s.spacing_mm() / static_cast<double>(planes.slabs.size());
      t_mm += slab.t.spacing_mm() / static_cast<double>(planes.slabs.size());
    }
    views.push_back({study.rig.camera(view.camera),
                     {planes.u.spacing_mm(), planes.v.spacing_mm(), s_mm, t_mm}});
  }
  return views;
}

/// The problem with X-rays that are ray casting's own DRRs at a pose, without masks.
std::shared_ptr<registration::RegistrationProblem> with_ideal_xrays(
    const registration::RegistrationProblem& problem,
    const registration::RegistrationProblem& ray_casting,
    const RigidTransform& room_from_ct) {
  auto result = std::make_shared<registration::RegistrationProblem>(problem);
  for (std::size_t i = 0; i < result->views.size(); ++i) {
    registration::RegistrationView& view = result->views[i];
    view.mask = view.mask_without_markers = Image2d();
    view.xray = render_image(
        *ray_casting.views[i].renderer, room_from_ct, View::whole_detector(view.view.camera));
  }
  return result;
}

/// The ends relative to the truth for every pose, by the requested methods.
std::vector<LatticeEnds> measured_ends(const std::vector<LoadedMethod>& methods,
                                       const LatticeErrorsOptions& options,
                                       const RigidTransform& gold_room_from_ct,
                                       const StudyCase& study_case,
                                       const std::vector<LatticePose>& poses) {
  const PoseFrame gold_frame = PoseFrame::about(gold_room_from_ct, study_case.center_ct_mm);
  const std::vector<Eigen::Vector3d> points = target_points(study_case.target_box_ct);
  std::vector<LatticeEnds> ends;
  for (const std::string& renderer : options.chosen_renderers()) ends.push_back({renderer, {}, {}});
  const auto pool = std::make_shared<ThreadPool>(thread_count(options.method.threads));
  ProgressPrinter progress("true poses", true);
  int done = 0;
  for (const LatticePose& pose : poses) {
    const RigidTransform truth = pose_from_parameters(gold_frame, pose.parameters);
    const PoseFrame frame = PoseFrame::about(truth, study_case.center_ct_mm);
    const RigidTransform start =
        pose_from_parameters(frame, PoseParameters::from_deg_and_mm(kStartDegAndMm));
    for (std::size_t i = 0; i < ends.size(); ++i) {
      const registration::Registration& loaded = methods[i].registration;
      registration::Registration ideal(
          with_ideal_xrays(*loaded.problem, *methods.back().registration.problem, truth),
          loaded.method,
          pool);
      const registration::RegistrationResult result = ideal.search(start);
      if (result.stop_reason == registration::StopReason::StepBelowFinal) {
        ends[i].errors.push_back(parameters_from_pose(frame, result.room_from_ct).deg_and_mm());
        ends[i].distance_mm.push_back(mean_tre_mm(result.room_from_ct, truth, points));
      } else {
        ends[i].errors.emplace_back().fill(std::numeric_limits<double>::quiet_NaN());
      }
    }
    progress.update(++done, static_cast<double>(poses.size()));
  }
  return ends;
}

CsvTable poses_table(const std::vector<LatticePose>& poses, const std::vector<LatticeEnds>& ends) {
  std::vector<CsvCells> rows;
  for (const LatticeEnds& run : ends)
    for (std::size_t i = 0; i < poses.size(); ++i) {
      CsvCells& cells = rows.emplace_back(CsvCells{{"renderer", run.renderer}, {"pose", i}});
      for (std::size_t axis = 0; axis < kCellAxisNames.size(); ++axis)
        cells.emplace_back(std::string(kCellAxisNames[axis]) + "_fraction",
                           poses[i].fraction[axis]);
      append("error_", kParameterNames, run.errors[i], cells);
    }
  return csv_table(std::move(rows));
}

std::string markdown(const std::vector<LatticePose>& poses,
                     const std::vector<LatticeEnds>& ends,
                     const std::vector<CellView>& views,
                     int fractions) {
  std::string text =
      "| Renderer | Cell of | mm, per camera | Amplitude, mm: tx, ty, tz | deg: rx, ry, rz "
      "|\n|---|---|---|---|---|\n";
  for (const LatticeEnds& run : ends)
    for (int axis = 0; axis < kCellAxes; ++axis) {
      const auto at = static_cast<std::size_t>(axis);
      const std::array<double, 6> values = amplitude_along(axis, poses, run.errors, fractions);
      text += "| " + run.renderer + " | " + kCellAxisNames[at] + " | ";
      for (std::size_t i = 0; i < views.size(); ++i)
        text += (i == 0 ? "" : ", ") + fixed_text(views[i].spacing_mm[at], 2);
      text += " |";
      for (const std::size_t first : {std::size_t{3}, std::size_t{0}})
        text += " " + fixed_text(values[first], 4) + ", " + fixed_text(values[first + 1], 4) +
                ", " + fixed_text(values[first + 2], 4) + " |";
      text += "\n";
    }
  for (const LatticeEnds& run : ends) {
    const SampleSummary distance = summarize(run.distance_mm);
    text += "\n" + run.renderer + ": " + std::to_string(distance.count) + " of " +
            std::to_string(poses.size()) +
            " converged; distance of the end from the true pose, mm: median " +
            fixed_text(distance.median, 4) + ", largest " + fixed_text(distance.maximum, 4) + "\n";
  }
  return text;
}

}  // namespace

std::vector<std::string> problems(const LatticeErrorsOptions& options) {
  std::vector<std::string> found = field_problems(options);
  append_problems(options, found);
  if (options.renderer == "raycast")
    found.emplace_back(
        "--renderer = raycast: must be field or both, because the cells are a field's");
  for (std::string& problem : table_problems(options.output)) found.push_back(std::move(problem));
  return found;
}

void LatticeErrorsOptions::describe(Fields& field) {
  field.part<MethodOptions>(*this);
  field("case", case_name, "Case of the study (default: its only one)");
  field("fractions",
        fractions,
        "Fractions of a cell along each of u, v, s and t; their cube is the number of true poses")
      .within(2, 10);
  field("output", output, "Markdown file to write; a CSV of the same name is written beside it")
      .as("-o,--output");
}

namespace {

void run_lattice_errors(const LatticeErrorsOptions& options,
                        const std::string& /*command_line*/,
                        const Communicator& world) {
  const std::filesystem::path csv = csv_beside(options.output);
  all_or_none(world, [&] {
    throw_if_any(problems(options));
    if (!world.is_root()) return;
    announce_output(csv);
    announce_output(options.output);
  });
  const Shared<Study> study = shared_study(options.study, world);
  const StudyCase study_case =
      all_or_none(world, [&] { return study->find_case(options.case_name); });
  const GoldStandard gold =
      all_or_none(world, [&] { return gold_standard(study, study_case, options.gold); });
  // Ray casting is always loaded, because it makes the X-rays.
  MethodOptions loading = static_cast<const MethodOptions&>(options);
  loading.renderer = "both";
  LoadedInputs ignored;
  const std::vector<LoadedMethod> methods =
      load_methods(loading, {}, study, study_case, world, ignored);
  const std::vector<CellView> views = cells_of(study, study_case, options, world);
  do_on_root(world, [&] {
    const std::vector<LatticePose> poses = lattice_poses(
        cell_steps(views, gold.room_from_ct * study_case.center_ct_mm), options.fractions);
    const std::vector<LatticeEnds> ends =
        measured_ends(methods, options, gold.room_from_ct, study_case, poses);
    const std::string text = markdown(poses, ends, views, options.fractions);
    write_text_file(csv, poses_table(poses, ends).to_text());
    write_text_file(options.output, text);
    std::cout << text;
  });
}

}  // namespace

cli::SubCommand lattice_errors_command(CLI::App& app) {
  return cli::sub_command(app,
                          "lattice-errors",
                          "Whether registrations lean towards the nodes of the fields, at true "
                          "poses that step through a cell",
                          run_lattice_errors);
}

}  // namespace af::evaluation
