// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/case_evaluation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>

#include "base/error.h"
#include "base/named_rows.h"
#include "base/stored_bytes.h"
#include "evaluate/registration/loaded_methods.h"
#include "evaluate/report/row_gathering.h"
#include "figures/picture.h"
#include "figures/study_pictures.h"
#include "files/foreign_file.h"
#include "files/number_json.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "files/sha256.h"
#include "geometry/target_box.h"
#include "ranks/resumable_items.h"
#include "ranks/root_only.h"
#include "ranks/work_watch.h"
#include "register/results/outline_picture.h"
#include "register/results/registration_results.h"
#include "register/results/slicer_folder.h"
#include "register/verdict/pose_covariance.h"
#include "study/node_ct.h"

namespace af::evaluation {
namespace {

using nlohmann::json;
using registration::PoseExaminer;
using registration::RegistrationRecord;

/// One renderer's share of a case.
struct Method {
  std::string renderer;
  registration::Registration registration;
  std::vector<std::int64_t> start_indices;  ///< ascending
  double success_tre_mm = kSuccessTreMm;    ///< only failures keep their traces

  [[nodiscard]] const registration::RegistrationProblem& problem() const {
    return *registration.problem;
  }
};

/// Whether a pose lies inside the motion range of every field in use. Where a field has no range
/// for this camera, all rays must be inside.
bool is_admissible(const std::vector<Method>& methods, const RigidTransform& room_from_ct) {
  for (const Method& method : methods)
    for (const registration::RegistrationView& view : method.problem().views)
      if (view.limit.has_value()
              ? view.limit->beyond(room_from_ct).any()
              : view.renderer->rays_outside(room_from_ct, view.widest_view()) > 0)
        return false;
  return true;
}

/// The motion range of the first field in use. The others may have another one.
std::optional<StartLimit> motion_limit(const std::vector<Method>& methods) {
  for (const Method& method : methods)
    for (const registration::RegistrationView& view : method.problem().views)
      if (view.reach.has_value()) return StartLimit{view.reach->frame, view.reach->range};
  return std::nullopt;
}

/// Rank 0: draws or reads a case's starts. `notes` receives remarks on what it read.
StratifiedStarts make_starts(const RegistrationStudyOptions& options,
                             const Study& study,
                             const StudyCase& study_case,
                             const Yardstick& yardstick,
                             const std::vector<Method>& methods,
                             std::vector<std::string>& notes) {
  StartMeasures measures(
      start_frame(study_case, yardstick),
      options.start_options(),
      yardstick.points_ct_mm,
      [&](const RigidTransform& pose) { return is_admissible(methods, pose); },
      motion_limit(methods));
  if (!options.starts_from.empty())
    return given_starts(options, study, study_case, yardstick, measures, notes);
  if (options.start_rule == "search")
    return starts_at(measures, std::array{study_case.nominal_room_from_ct});
  if (options.start_rule == "within-range") return starts_within_range(measures, "--start-rule");
  return options.start_rule == "uniform" ? uniform_starts(measures) : stratified_starts(measures);
}

/// Collective. Gives rank 0's starts to every rank, held once per node: one copy per rank would
/// fill a node with ten million starts.
SharedArray<PerturbedStart> held_per_node(const SharedArray<PerturbedStart>& starts,
                                          const Communicator& world) {
  static_assert(std::is_trivially_destructible_v<PerturbedStart> &&
                alignof(PerturbedStart) <= Communicator::kNodeMemoryAlignment);
  if (world.size() == 1) return starts;
  const std::size_t count = on_root(world, [&] { return starts.size(); }).share();
  if (count == 0) return {};
  const auto owner = world.allocate_on_nodes_from_root(
      count * sizeof(PerturbedStart), [&](std::span<std::byte> memory) {
        std::uninitialized_copy(starts.data(),
                                starts.data() + starts.size(),
                                reinterpret_cast<PerturbedStart*>(memory.data()));
      });
  return {owner, {reinterpret_cast<const PerturbedStart*>(owner.get()), count}};
}

/// Assigns starts to methods. With both renderers, ray casting may be given fewer intervals and
/// starts.
void assign_starts(const RegistrationStudyOptions& options,
                   const StratifiedStarts& starts,
                   Method& method) {
  if (options.only_start.has_value()) {
    if (static_cast<std::size_t>(*options.only_start) >= starts.starts.size())
      throw InputError(
          "--only-start",
          std::to_string(*options.only_start),
          "must be less than the number of starts, " + std::to_string(starts.starts.size()));
    method.start_indices = {*options.only_start};
    return;
  }
  const bool is_reduced = options.renderer == "both" && method.renderer == "raycast";
  const int intervals =
      is_reduced ? options.raycast_intervals.value_or(options.intervals) : options.intervals;
  const int per_interval =
      is_reduced ? options.raycast_starts_per_interval.value_or(options.starts_per_interval)
                 : options.starts_per_interval;
  if (!is_reduced) method.start_indices.reserve(starts.starts.size());
  // For the other methods every start counts, including those of a file that lie beyond the
  // intervals.
  for (std::size_t i = 0; i < starts.starts.size(); ++i)
    if (!is_reduced ||
        (starts.starts[i].interval < intervals && starts.starts[i].rank_in_interval < per_interval))
      method.start_indices.push_back(static_cast<std::int64_t>(i));
}

/// Squared Mahalanobis distance of an end's error by its covariance. NaN when either is missing.
double squared_distance_of(const RegistrationRow& row) {
  if (!std::isfinite(row.uncertainty.covariance_deg_mm[0])) return RegistrationRow::kMissing;
  const PoseParameters error = PoseParameters::from_deg_and_mm(row.final_deg_mm);
  registration::PoseVector error_rad_mm;
  error_rad_mm << error.rotation_rad, error.translation_mm;
  return registration::squared_distance(
      registration::from_deg_mm(row.uncertainty.covariance_deg_mm), error_rad_mm);
}

/// The row of one start, without its case. A failure has its trace.
TracedRow traced_row(Method& method,
                     const PerturbedStart& start,
                     std::int64_t index,
                     const Yardstick& yardstick) {
  std::vector<registration::TraceRow> trace;
  TracedRow traced;
  RegistrationRow& row = traced.row;
  row = registered_row(
      [&](const RigidTransform& room_from_ct) {
        RegistrationRecord record = method.registration.pose_search.has_value()
                                        ? method.registration.run_everywhere(index)
                                        : method.registration.run(room_from_ct, index);
        trace = std::move(record.result.trace);
        return record;
      },
      start,
      yardstick);
  row.renderer = method.renderer;
  row.start_index = index;
  if (!row.is_success(method.success_tre_mm))
    traced.trace = trace_points(trace, method.problem().frame(), yardstick);
  return traced;
}

/// What is kept of a method when its fields are released.
struct MethodRows {
  std::string renderer;
  std::vector<std::int64_t> start_indices;  ///< rank 0 only
  ResumableItems items;                     ///< one per start index

  /// Rank 0: calls `receive` with the row of every start.
  void visit(const std::function<void(std::int64_t start_index, TracedRow traced)>& receive) const {
    items.visit([&](std::int64_t index, std::span<const std::byte> record) {
      receive(index, value_of<TracedRow>(record, renderer + " rows"));
    });
  }
};

/// Collective. Registers every start of one method that is not finished. Methods come one after the
/// other, so that blocks of the work queue hold work of one duration.
void register_with(Method& method,
                   const std::string& case_name,
                   const StratifiedStarts& starts,
                   const Yardstick& yardstick,
                   ResumableItems& items) {
  std::size_t traced = 0;
  items.complete(method.start_indices,
                 "case " + case_name + ", " + method.renderer + " registrations",
                 [&](std::int64_t index) {
                   TracedRow traced_start = traced_row(
                       method, starts.starts[static_cast<std::size_t>(index)], index, yardstick);
                   traced_start.row.case_name = case_name;
                   // Items come in order, so the first failures of a rank are its share of the
                   // first failures of all.
                   if (!traced_start.trace.empty() && ++traced > kMostTraces)
                     traced_start.trace.clear();
                   return bytes_of(traced_start);
                 });
}

/// Rank 0: adds the rows of a method, by start index, and returns its traces.
FirstTraces add_rows(const MethodRows& method, std::vector<RegistrationRow>& rows) {
  FirstTraces traces;
  const std::vector<std::int64_t>& indices = method.start_indices;
  const std::size_t first = rows.size();
  rows.resize(first + indices.size());
  method.visit([&](std::int64_t index, TracedRow traced) {
    const auto place = std::lower_bound(indices.begin(), indices.end(), index);
    rows[first + static_cast<std::size_t>(place - indices.begin())] = std::move(traced.row);
    keep_if_first(index, std::move(traced.trace), traces);
  });
  return traces;
}

/// Typical number of poses that a method tries: the median of preset paper, and that of robust,
/// whose steps come from normal equations.
double usual_poses(const registration::RegistrationOptions& options) {
  return options.optimizer_list().find("newton") == std::string::npos ? 400.0 : 15.0;
}

/// Rank 0 says how long each method will take, from a sample. With fields the sample is one row.
/// With ray casting, where that would be long, it is one similarity for each of the poses that the
/// field's sample tried.
void announce_times(std::vector<Method>& methods,
                    const std::string& case_name,
                    const StratifiedStarts& starts,
                    const Yardstick& yardstick,
                    const Communicator& world) {
  std::optional<double> poses_tried;  // from the field's sample
  for (Method& method : methods) {
    if (method.start_indices.empty()) continue;
    const std::int64_t index = method.start_indices[method.start_indices.size() / 2];
    const PerturbedStart& start = starts.starts[static_cast<std::size_t>(index)];
    announce_time(world,
                  "case " + case_name + ", " + method.renderer + " registrations",
                  static_cast<std::int64_t>(method.start_indices.size()),
                  [&] {
                    if (method.renderer == "field") {
                      const RegistrationRow row = traced_row(method, start, index, yardstick).row;
                      if (!row.error.empty()) throw NumericError(row.error);
                      poses_tried = static_cast<double>(row.evaluations);
                      return 1.0;
                    }
                    std::ignore = method.registration.similarity_at(start.room_from_ct);
                    return poses_tried.value_or(usual_poses(method.registration.method));
                  });
  }
}

/// Every option, input and start that decides a case's rows.
DecidingValues deciding_values(const RegistrationStudyOptions& options,
                               const CaseEvaluation& evaluation) {
  DecidingValues values =
      af::deciding_values(deciding_options(options), evaluation.inputs.identities);
  values["case name"] = evaluation.case_name;
  Sha256 starts;
  for (const PerturbedStart& start : evaluation.starts.starts) {
    const Eigen::Matrix4d matrix = start.room_from_ct.matrix();
    starts.update(std::as_bytes(std::span(matrix.data(), 16)));
  }
  values["SHA-256 of the starts"] = starts.hex_digest();
  return values;
}

void draw_xrays(const registration::RegistrationProblem& problem,
                const std::filesystem::path& folder,
                CaseEvaluation& evaluation) {
  std::vector<PicturePanel> panels;
  for (const registration::RegistrationView& view : problem.views) {
    const auto [low, high] = percentile_window(view.xray);
    panels.push_back({view.xray,
                      low,
                      high,
                      "X-ray " + view.view.camera.name,
                      "attenuation; the frame is the region of interest",
                      PicturePanel::Colors::Grey,
                      {view.view.roi}});
  }
  const std::string name = file_name_part(evaluation.case_name) + "-xrays.png";
  write_picture(
      panels, static_cast<int>(panels.size()), "Case " + evaluation.case_name, folder / name);
  evaluation.pictures.push_back(
      {{"file", name}, {"case", evaluation.case_name}, {"which", "xrays"}});
}

/// A registration to show in pictures.
struct ChosenRow {
  const char* which;
  RegistrationRow row;
};

/// Rank 0: the rows of the best, median and worst registration of a method; none when none has a
/// pose. Rows are visited twice instead of held: memory holds fields at this point.
std::vector<ChosenRow> chosen_rows(const MethodRows& method) {
  std::vector<std::pair<double, std::int64_t>> by_error;
  method.visit([&](std::int64_t index, const TracedRow& traced) {
    const double error_mm = traced.row.decisive_mm();
    if (std::isfinite(error_mm)) by_error.emplace_back(error_mm, index);
  });
  if (by_error.empty()) return {};
  std::sort(by_error.begin(), by_error.end());
  by_error.erase(std::unique(by_error.begin(), by_error.end()), by_error.end());
  const std::array<std::pair<const char*, std::int64_t>, 3> wanted = {
      {{"best", by_error.front().second},
       {"median", by_error[(by_error.size() - 1) / 2].second},
       {"worst", by_error.back().second}}};
  std::vector<ChosenRow> chosen;
  chosen.reserve(wanted.size());
  for (const auto& [which, index] : wanted) chosen.push_back({which, {}});
  method.visit([&](std::int64_t index, const TracedRow& traced) {
    for (std::size_t i = 0; i < wanted.size(); ++i)
      if (index == wanted[i].second) chosen[i].row = traced.row;
  });
  return chosen;
}

/// Draws overlays of chosen registrations, and writes what Slicer loads of each.
void draw_overlays(const Method& method,
                   const std::vector<ChosenRow>& chosen,
                   const StudyCase& study_case,
                   const Yardstick& yardstick,
                   const std::filesystem::path& folder,
                   CaseEvaluation& evaluation) {
  for (const auto& [which, row] : chosen) {
    const RigidTransform pose = yardstick.pose_of(row.final_deg_mm);
    const RigidTransform start = yardstick.pose_of(row.start_deg_mm);
    const std::string slicer = "slicer/" + file_name_part(evaluation.case_name) + "-" + which;
    registration::write_slicer_folder(method.problem(), pose, study_case, folder / slicer);
    for (const registration::RegistrationView& view : method.problem().views) {
      const std::string& camera = view.view.camera.name;
      const std::string name = file_name_part(evaluation.case_name) + "-" + which + "-" +
                               file_name_part(camera) + ".png";
      registration::write_overlay(view,
                                  pose,
                                  evaluation.case_name + ", view " + camera + ", " + which +
                                      " result: " + row.decisive_name() + " " +
                                      fixed_text(row.decisive_mm(), 2) + " mm",
                                  folder / name);
      evaluation.pictures.push_back({{"file", name},
                                     {"case", evaluation.case_name},
                                     {"which", which},
                                     {"camera", camera},
                                     {"slicer", slicer},
                                     {"renderer", row.renderer},
                                     {"start_index", row.start_index},
                                     {"initial_tre_mm", row.initial_tre_mm},
                                     {"error", row.decisive_name()},
                                     {"error_mm", row.decisive_mm()},
                                     {"depth_mm", number_json(row.errors.depth_mm)},
                                     {"tre_mm", row.tre_mm}});
      nlohmann::json outlines = evaluation.pictures.back();
      outlines["file"] = file_name_part(evaluation.case_name) + "-" + which + "-" +
                         file_name_part(camera) + "-outlines.png";
      outlines["shows"] = "outlines";
      registration::write_outlines(
          view,
          start,
          pose,
          evaluation.case_name + ", view " + camera + ", " + which + " result",
          folder / outlines["file"].get<std::string>());
      evaluation.pictures.push_back(std::move(outlines));
    }
  }
}

/// Collective. Finds out which items of each method are finished, and does none yet.
std::vector<MethodRows> begin_registrations(const RegistrationStudyOptions& options,
                                            const CaseEvaluation& evaluation,
                                            const std::vector<Method>& methods,
                                            const RunFolder& run,
                                            const Communicator& world) {
  const std::string name = file_name_part(evaluation.case_name);
  DecidingValues decides;
  do_on_root(world, [&] { decides = deciding_values(options, evaluation); });
  std::vector<MethodRows> begun;
  begun.reserve(methods.size());
  for (const Method& method : methods)
    begun.push_back({method.renderer,
                     world.is_root() ? method.start_indices : std::vector<std::int64_t>(),
                     {run.unfinished(name + "-" + method.renderer, decides), world}});
  return begun;
}

/// Rank 0: draws the pictures of a case, by its first method.
void draw_pictures(const RegistrationStudyOptions& options,
                   const StudyCase& study_case,
                   const Method& method,
                   const MethodRows& rows,
                   const Yardstick& yardstick,
                   CaseEvaluation& evaluation) {
  const WorkNote note("drawing case " + study_case.name, WorkNote::Kind::Phase);
  draw_xrays(method.problem(), options.output_folder, evaluation);
  draw_overlays(
      method, chosen_rows(rows), study_case, yardstick, options.output_folder, evaluation);
}

/// Rank 0: the first method that holds all rays of a view, which is as good as the CT for looking
/// at it. Otherwise rays are cast through the CT, which is then read. `methods` must outlive it.
ViewRenderer setting_renderer(const std::vector<Method>& methods, const StudyCase& study_case) {
  return [&, cast = ViewRenderer()](const View& view, const RigidTransform& pose) mutable {
    for (const Method& method : methods)
      for (const registration::RegistrationView& known : method.problem().views)
        if (known.view.camera.name == view.camera.name &&
            known.renderer->rays_outside(pose, view) == 0)
          return known.renderer;
    if (!cast) cast = cast_views(read_case_ct(study_case));
    return cast(view, pose);
  };
}

/// Rank 0: draws how cameras, X-rays and poses of a case fit together. That was the same before
/// anything was registered.
void draw_setting(const RegistrationStudyOptions& options,
                  const Study& study,
                  const StudyCase& study_case,
                  const std::vector<Method>& methods,
                  CaseEvaluation& evaluation) {
  const WorkNote note("drawing the setting of case " + study_case.name, WorkNote::Kind::Phase);
  // Kept small, because a report holds the pictures of all cases.
  constexpr int kMostPixels = 320;
  const StudyPictures pictures = draw_study_pictures(study,
                                                     study_case,
                                                     methods.front().problem().ct_grid.value(),
                                                     setting_renderer(methods, study_case),
                                                     kMostPixels,
                                                     options.output_folder,
                                                     file_name_part(study_case.name) + "-setting");
  // There is one for each view, then the room.
  for (std::size_t i = 0; i < pictures.files.size(); ++i)
    evaluation.pictures.push_back(
        {{"file", pictures.files[i].filename().string()},
         {"case", evaluation.case_name},
         {"which", "setting"},
         {"shows", i < study_case.views.size() ? "camera " + study_case.views[i].camera : "room"},
         {"facts", pictures.facts},
         {"telltales", pictures.telltales}});
}

}  // namespace

StartFrame start_frame(const StudyCase& study_case, const Yardstick& yardstick) {
  return {study_case.name,
          yardstick.gold_room_from_ct,
          study_case.center_ct_mm,
          study_case.target_box_ct};
}

PoseTableFrames pose_table_frames(const RegistrationStudyOptions& options,
                                  const Study& study,
                                  const StudyCase& study_case,
                                  const RigidTransform& gold_room_from_ct) {
  const std::size_t cases = options.cases.empty() ? study.cases.size() : options.cases.size();
  const std::vector<std::string> known = names_of(study.cases);
  return {study_case.name,
          cases == 1,
          {known.begin(), known.end()},
          PoseFrame::about(gold_room_from_ct, study_case.center_ct_mm),
          PoseFrame::about(study_case.nominal_room_from_ct, study_case.center_ct_mm),
          {study_case.frame(), conversion_options(options.study, study_case.name)}};
}

StratifiedStarts given_starts(const RegistrationStudyOptions& options,
                              const Study& study,
                              const StudyCase& study_case,
                              const Yardstick& yardstick,
                              StartMeasures& measures,
                              std::vector<std::string>& notes) {
  return starts_at(
      measures,
      read_starts(options.starts_from,
                  pose_table_frames(options, study, study_case, yardstick.gold_room_from_ct),
                  notes));
}

void set_start(const PerturbedStart& start, RegistrationRow& row) {
  row.draw_index = start.draw_index;
  row.interval = start.interval;
  row.start_deg_mm = start.parameters.deg_and_mm();
  row.initial_tre_mm = start.initial_tre_mm;
}

RegistrationRow registered_row(
    const std::function<RegistrationRecord(const RigidTransform& start)>& run,
    const PerturbedStart& start,
    const Yardstick& yardstick) {
  RegistrationRow row;
  set_start(start, row);
  row.has_one_view = yardstick.has_one_view();
  try {
    const RegistrationRecord record = run(start.room_from_ct);
    set_result(record, row);
    if (record.view_values.empty()) row.verdict.clear();  // --no-uncertainty: nothing was judged
    if (record.result.has_pose()) {
      measure_pose(record.result.room_from_ct, yardstick, row);
      row.squared_distance = squared_distance_of(row);
    } else {
      row.similarity = RegistrationRow::kMissing;
      row.judge = RegistrationRow().judge;
    }
  } catch (const std::exception& error) {
    row.stop_reason = "error";
    row.error = error.what();
  }
  return row;
}

namespace {

/// Of the image pyramids, for verdicts and a search of starts.
int levels_beyond_stages(const RegistrationStudyOptions& options,
                         const registration::UncertaintyOptions& uncertainty) {
  const int judging = uncertainty.is_left_out ? 0 : PoseExaminer::coarsest_level();
  return options.start_rule == "search" ? std::max(judging, coarsest_level(options.search))
                                        : judging;
}

}  // namespace

CaseEvaluation evaluate_case(const RegistrationStudyOptions& options,
                             const Study& study,
                             const StudyCase& study_case,
                             const RunFolder& run,
                             const std::shared_ptr<registration::KeptFields>& kept_fields,
                             const Communicator& world,
                             const std::function<void(const CaseEvaluation&)>& on_starts,
                             std::vector<RegistrationRow>& all_rows) {
  CaseEvaluation evaluation;
  evaluation.case_name = study_case.name;
  std::optional<WorkNote> phase(
      std::in_place, "loading case " + study_case.name, WorkNote::Kind::Phase);
  std::vector<Method> methods;
  registration::UncertaintyOptions uncertainty = options.uncertainty;
  uncertainty.is_left_out = uncertainty.is_left_out || options.is_starts_only;
  for (LoadedMethod& method : load_methods(options,
                                           options.correction,
                                           study,
                                           study_case,
                                           world,
                                           evaluation.inputs,
                                           levels_beyond_stages(options, uncertainty),
                                           kept_fields)) {
    all_or_none(world, [&] {
      if (!uncertainty.is_left_out) method.registration.examine_ends(uncertainty);
      if (options.start_rule == "search") method.registration.look_for_starts(options.search);
      methods.push_back(
          {method.renderer, std::move(method.registration), {}, options.success_tre_mm});
    });
  }
  const Yardstick yardstick = all_or_none(world, [&] {
    evaluation.gold = gold_standard(study, study_case, options.gold);
    return yardstick_of(study, study_case, evaluation.gold);
  });
  do_on_root(world, [&] {
    evaluation.starts =
        make_starts(options, study, study_case, yardstick, methods, evaluation.pose_problems);
  });
  evaluation.starts.starts = held_per_node(evaluation.starts.starts, world);
  evaluation.start_count = evaluation.starts.starts.size();
  all_or_none(world, [&] {
    for (Method& method : methods) assign_starts(options, evaluation.starts, method);
  });
  // Refusals come first, so that they leave the results of an earlier run alone.
  std::vector<MethodRows> rows;
  if (!options.is_starts_only) rows = begin_registrations(options, evaluation, methods, run, world);
  do_on_root(world, [&] { on_starts(evaluation); });
  if (options.is_starts_only) {
    evaluation.starts.starts = {};
    return evaluation;
  }
  announce_times(methods, study_case.name, evaluation.starts, yardstick, world);
  phase.reset();
  for (std::size_t i = 0; i < methods.size(); ++i)
    register_with(methods[i], study_case.name, evaluation.starts, yardstick, rows[i].items);
  // The starts are released before the rows come: memory has room for only one of the two.
  evaluation.starts.starts = {};
  do_on_root(world, [&] {
    if (options.pictures.are_left_out) return;
    draw_pictures(options, study_case, methods.front(), rows.front(), yardstick, evaluation);
    draw_setting(options, study, study_case, methods, evaluation);
  });
  // Fields and CT are released before the rows come: memory has room for only one of the two. Only
  // fields that the next case also uses stay (KeptFields).
  methods.clear();
  do_on_root(world, [&] {
    const WorkNote note("reading the rows of case " + study_case.name, WorkNote::Kind::Phase);
    for (const MethodRows& method : rows)
      evaluation.traces[method.renderer] = add_rows(method, all_rows);
  });
  return evaluation;
}

}  // namespace af::evaluation
