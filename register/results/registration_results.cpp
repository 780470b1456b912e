// SPDX-License-Identifier: Apache-2.0
#include "register/results/registration_results.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.h"
#include "base/joined.h"
#include "figures/picture.h"
#include "files/output_file.h"
#include "register/problem/silhouette.h"
#include "study/pose_file.h"

namespace af::registration {
namespace {

using nlohmann::json;

constexpr int kCheckerFields = 8;  ///< along the region's longer side

json number_or_null(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

json parameters_json(const PoseParameters& parameters) {
  const std::array<double, 6> values = parameters.deg_and_mm();
  return {{"rotation_deg", {values[0], values[1], values[2]}},
          {"translation_mm", {values[3], values[4], values[5]}}};
}

json trace_json(const std::vector<TraceRow>& trace) {
  json rows = json::array();
  for (const TraceRow& row : trace) {
    json entry = parameters_json(row.parameters);
    entry["pass"] = row.pass + 1;
    entry["step_mm"] = row.step_mm;
    entry["evaluations"] = row.evaluations;
    entry["similarity"] = number_or_null(row.similarity);
    rows.push_back(entry);
  }
  return rows;
}

/// The gain and offset that fit `from` to `to` by least squares. The gain is 0 when `from` is
/// constant.
std::array<double, 2> linear_fit(const Image2d& from, const Image2d& to) {
  const auto n = static_cast<double>(from.pixels.size());
  double sum_from = 0.0;
  double sum_to = 0.0;
  for (std::size_t i = 0; i < from.pixels.size(); ++i) {
    sum_from += static_cast<double>(from.pixels[i]);
    sum_to += static_cast<double>(to.pixels[i]);
  }
  double variance = 0.0;
  double covariance = 0.0;
  for (std::size_t i = 0; i < from.pixels.size(); ++i) {
    const double centred = static_cast<double>(from.pixels[i]) - sum_from / n;
    variance += centred * centred;
    covariance += centred * (static_cast<double>(to.pixels[i]) - sum_to / n);
  }
  const double gain = variance > 0.0 ? covariance / variance : 0.0;
  return {gain, (sum_to - gain * sum_from) / n};
}

std::string short_text(double value) {
  std::ostringstream out;
  out.precision(3);
  out << value;
  return out.str();
}

std::string parameters_line(const PoseParameters& parameters) {
  const std::array<double, 6> values = parameters.deg_and_mm();
  std::string line;
  for (std::size_t i = 0; i < values.size(); ++i)
    line += (i == 0 ? "" : i == 3 ? " deg,  " : ", ") + fixed_text(values[i], 2);
  return line + " mm";
}

/// "by 2 ray-cast DRRs per view, which moved the end 0.041 mm; it has settled"
std::string correction_text(const CorrectionReport& correction) {
  if (correction.casts == 0)
    return "no: the search before it did not converge, or --max-evaluations was used up";
  const std::string casts = std::to_string(correction.casts) + " ray-cast DRR" +
                            (correction.casts == 1 ? "" : "s") + " per view";
  if (std::isnan(correction.moved_mm))
    return "no: " + casts + " led to a pose that is not admissible or has no value";
  return "by " + casts + ", which moved the end " + fixed_text(correction.moved_mm, 3) + " mm; " +
         (correction.stood_still ? "it has settled"
                                 : "it has not settled: the last one moved it " +
                                       fixed_text(correction.last_mm, 3) + " mm");
}

/// "3 found, 1 doubtful, 0 not found"
std::string counts_text(const std::vector<RegistrationRecord>& records) {
  std::array<int, 3> counts{};
  for (const RegistrationRecord& record : records)
    ++counts[static_cast<std::size_t>(judgement_of(record).verdict)];
  return joined(kVerdicts, ", ", [&](Verdict verdict) {
    return std::to_string(counts[static_cast<std::size_t>(verdict)]) + " " + to_string(verdict);
  });
}

bool is_not_found(const RegistrationRecord& record) {
  return judgement_of(record).verdict == Verdict::NotFound;
}

json views_json(const RegistrationRecord& record, const RegistrationProblem& problem) {
  const std::vector<ViewValue>& values = record.view_values;
  json views = json::array();
  bool agree = record.diagnosis.messages.empty();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool is_judged = std::isfinite(values[i].coarse) && std::isfinite(values[i].fine);
    const bool agrees = !disagrees(i, values);
    agree = agree && agrees;
    views.push_back({{"camera", problem.views[i].view.camera.name},
                     {"judge_value", number_or_null(values[i].coarse)},
                     {"judge_value_fine", number_or_null(values[i].fine)},
                     {"judge_value_beside", number_or_null(values[i].background)},
                     {"agrees", is_judged ? json(agrees) : json()}});
  }
  return {{"verdict", agree ? "no fault found" : "suspicious"},
          {"findings", record.diagnosis.messages},
          {"cameras", views}};
}

/// Covariance as six rows. null for unknown values.
json uncertainty_json(const RegistrationRecord& record) {
  const UncertaintyReport& report = record.uncertainty;
  json covariance = nullptr;
  if (std::isfinite(report.covariance_deg_mm[0])) {
    covariance = json(std::vector(6, std::vector(6, 0.0)));
    std::size_t next = 0;
    for (std::size_t row = 0; row < 6; ++row)
      for (std::size_t column = row; column < 6; ++column, ++next)
        covariance[row][column] = covariance[column][row] = report.covariance_deg_mm[next];
  }
  return {{"covariance_deg_mm", covariance},
          {"parameters", kParameterNames},
          {"frame", "motions after the pose found, about the ROI centre, along the room's axes"},
          {"inflation", number_or_null(report.inflation)},
          {"tre_inflation", number_or_null(report.tre_inflation)},
          {"tre_rms_mm", number_or_null(report.tre_rms_mm)},
          {"tre_95_mm", number_or_null(report.tre_95_mm)},
          {"sandwich_tre_mm", number_or_null(report.sandwich_tre_mm)},
          {"depth_95_mm", number_or_null(report.depth_95_mm)},
          {"target_share", number_or_null(report.target.share)},
          {"target_apart_mm", number_or_null(report.target.apart_mm)},
          {"chain_distance_mm", number_or_null(record.result.chain_distance_mm)},
          {"confidence", number_or_null(report.confidence)}};
}

/// null: all starts ended at the same place.
json rival_json(const std::optional<RivalEnd>& rival) {
  if (!rival.has_value()) return nullptr;
  return {{"apart_mm", rival->apart_mm}, {"share", rival->share}};
}

json correction_json(const CorrectionReport& correction) {
  return {{"casts_per_view", correction.casts},
          {"moved_mm", number_or_null(correction.moved_mm)},
          {"last_mm", number_or_null(correction.last_mm)},
          {"stood_still", correction.stood_still}};
}

}  // namespace

json result_json(const RegistrationRecord& record,
                 const RegistrationProblem& problem,
                 const RunDescription& run) {
  const RegistrationResult& result = record.result;
  const PoseFrame frame = problem.frame();
  json output;
  output["format"] = "attenuation-fields registration result";
  output["format_version"] = 1;
  output["case"] = run.case_name;
  output["renderer"] = run.renderer;
  output["start_index"] = record.start_index;
  const Judgement judgement = judgement_of(record);
  const bool is_rejected = judgement.verdict == Verdict::NotFound;
  output["verdict"] = to_string(judgement.verdict);
  output["verdict_reason"] = judgement.reason;
  output["views"] = views_json(record, problem);
  output[is_rejected ? "rejected_room_from_ct" : "room_from_ct"] = pose_rows(result.room_from_ct);
  output["start_room_from_ct"] = pose_rows(result.start_room_from_ct);
  output["nominal_room_from_ct"] = pose_rows(problem.nominal_room_from_ct);
  output["center_ct_mm"] = {
      problem.center_ct_mm.x(), problem.center_ct_mm.y(), problem.center_ct_mm.z()};
  output[is_rejected ? "rejected_parameters_relative_to_nominal"
                     : "parameters_relative_to_nominal"] =
      parameters_json(parameters_from_pose(frame, result.room_from_ct));
  output["start_parameters_relative_to_nominal"] =
      parameters_json(parameters_from_pose(frame, result.start_room_from_ct));
  if (!run.landmarks.is_null()) output["start_landmarks"] = run.landmarks;
  if (!run.search.is_null()) {
    output["start_search"] = run.search;
    output["rival"] = rival_json(record.rival);
  }
  output["similarity"] = number_or_null(result.similarity);
  output["evaluations"] = result.evaluations;
  output["inadmissible_evaluations"] = result.inadmissible;
  output["drr_count"] = result.drr_count;
  output["rays_outside_at_start"] = result.rays_outside;
  output["stop_reason"] = to_string(result.stop_reason);
  output["seconds"] = result.seconds;
  output["initial_tre_mm"] =
      record.errors.has_value() ? number_or_null(record.errors->initial_tre_mm) : json(nullptr);
  output["tre_mm"] =
      record.errors.has_value() ? number_or_null(record.errors->tre_mm) : json(nullptr);
  output["uncertainty"] = uncertainty_json(record);
  if (result.correction.has_value()) output["correction"] = correction_json(*result.correction);
  output["gold_source"] =
      record.errors.has_value() ? json(record.errors->gold_source) : json(nullptr);
  output["chain"] = result.chain;
  output["trace"] = trace_json(result.trace);
  return output;
}

void set_result(const RegistrationRecord& record, RegistrationRow& row) {
  const RegistrationResult& result = record.result;
  row.start_index = record.start_index;
  row.similarity = result.similarity;
  row.evaluations = result.evaluations;
  row.stop_reason = to_string(result.stop_reason);
  row.inadmissible = result.inadmissible;
  row.drr_count = result.drr_count;
  row.chain = result.chain;
  row.verdict = to_string(judgement_of(record).verdict);
  row.judge = judge_summary(record.view_values);
  row.uncertainty = record.uncertainty;
  row.chain_distance_mm = result.chain_distance_mm;
  row.correction = result.correction;
  row.seconds = result.seconds;
}

namespace {

CsvCells cells_of(const RegistrationRecord& record,
                  const PoseFrame& frame,
                  const RunDescription& run) {
  RegistrationRow row;
  row.case_name = run.case_name;
  row.renderer = run.renderer;
  set_result(record, row);
  row.start_deg_mm = parameters_from_pose(frame, record.result.start_room_from_ct).deg_and_mm();
  row.final_deg_mm = parameters_from_pose(frame, record.result.room_from_ct).deg_and_mm();
  if (record.errors.has_value()) {
    row.initial_tre_mm = record.errors->initial_tre_mm;
    row.tre_mm = record.errors->tre_mm;
  }
  return registration_cells(row,
                            {.uncertainty = true, .correction = row.correction.has_value()},
                            {.behind_verdict = {{"relative_to", "nominal"}}});
}

}  // namespace

CsvTable registrations_table(std::vector<RegistrationRecord> records,
                             const RegistrationProblem& problem,
                             const RunDescription& run) {
  std::ranges::sort(records, {}, &RegistrationRecord::start_index);
  std::vector<CsvCells> rows;
  for (const RegistrationRecord& record : records)
    rows.push_back(cells_of(record, problem.frame(), run));
  return csv_table(std::move(rows));
}

namespace {

/// What pictures show of a view's region, in pixels of the region. It is the whole region or, where
/// the CT is a small body in it, the silhouette's box and a third of its size around it.
RegionOfInterest shown_region(const Image2d& drr) {
  const std::vector<std::uint8_t> body = silhouette(drr, 0.0, {});
  const RegionOfInterest tight = region_of(body, drr.width, drr.height, 0);
  const int border = std::max(tight.width, tight.height) / 3;
  const RegionOfInterest wide = region_of(body, drr.width, drr.height, border);
  const RegionOfInterest whole = {0, 0, drr.width, drr.height};
  return wide.pixel_count() == 0 || 2 * wide.pixel_count() > whole.pixel_count() ? whole : wide;
}

/// Makes masked pixels, such as those beyond an aperture, no brighter than the brightest others, so
/// that these get all greys.
void tame_masked(const Image2d& mask, Image2d& xray) {
  float highest = -std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < xray.pixels.size(); ++i)
    if (mask.pixels[i] != 0.0f) highest = std::max(highest, xray.pixels[i]);
  for (std::size_t i = 0; i < xray.pixels.size(); ++i)
    if (mask.pixels[i] == 0.0f) xray.pixels[i] = std::min(xray.pixels[i], highest);
}

/// The border of a silhouette: a line between each of its pixels and a neighbour outside.
std::vector<PictureLine> outline(const Image2d& drr) {
  const std::vector<std::uint8_t> body = silhouette(drr, 0.0, {});
  const auto is_body = [&](int column, int row) {
    return column >= 0 && row >= 0 && column < drr.width && row < drr.height &&
           body[static_cast<std::size_t>(row) * static_cast<std::size_t>(drr.width) +
                static_cast<std::size_t>(column)] != 0;
  };
  std::vector<PictureLine> lines;
  const auto add = [&](double x0, double y0, double x1, double y1) {
    lines.push_back({{{x0, y0}, {x1, y1}}, PictureColor::Red, 1.0});
  };
  for (int row = 0; row <= drr.height; ++row)
    for (int column = 0; column <= drr.width; ++column) {
      const double left = column - 0.5;
      const double top = row - 0.5;
      if (is_body(column, row) != is_body(column - 1, row)) add(left, top, left, top + 1.0);
      if (is_body(column, row) != is_body(column, row - 1)) add(left, top, left + 1.0, top);
    }
  return lines;
}

}  // namespace

void write_overlay(const RegistrationView& view,
                   const RigidTransform& room_from_ct,
                   const std::string& heading,
                   const std::filesystem::path& path) {
  std::int64_t rays_outside = 0;
  Image2d drr = render_image(*view.renderer, room_from_ct, view.view, &rays_outside);
  const RegionOfInterest shown = shown_region(drr);
  const bool is_body_alone = shown.pixel_count() < drr.pixels.size();
  drr = crop(drr, shown);
  Image2d xray = crop(crop(view.xray, view.view.roi), shown);
  if (is_body_alone && !view.mask.pixels.empty())
    tame_masked(crop(crop(view.mask, view.view.roi), shown), xray);
  const auto drr_window = percentile_window(drr);
  PicturePanel drr_panel{drr, drr_window[0], drr_window[1], "DRR", "", {}, {}};
  drr_panel.caption = "attenuation";
  if (rays_outside > 0)
    drr_panel.caption += ", " + std::to_string(rays_outside) + " rays outside the field";
  const auto [gain, offset] = linear_fit(drr, xray);
  Image2d difference = xray;
  for (std::size_t i = 0; i < difference.pixels.size(); ++i)
    difference.pixels[i] -= static_cast<float>(gain) * drr.pixels[i] + static_cast<float>(offset);
  const auto xray_window = percentile_window(xray);
  const double half_range = (xray_window[1] - xray_window[0]) / 4.0;
  const int field_px = std::max(1, std::max(xray.width, xray.height) / kCheckerFields);
  const PicturePanel xray_panel{
      xray, xray_window[0], xray_window[1], "X-ray", "attenuation", {}, {}};
  const PicturePanel checker_panel{checkerboard(xray, drr, field_px),
                                   0.0,
                                   1.0,
                                   "Checkerboard",
                                   "X-ray first, 1st to 99th percentile each",
                                   {},
                                   {}};
  const PicturePanel difference_panel{difference,
                                      -half_range,
                                      half_range,
                                      "Difference",
                                      "X-ray - (" + short_text(gain) + " DRR " +
                                          (offset < 0.0 ? "- " : "+ ") +
                                          short_text(std::abs(offset)) + "), attenuation",
                                      PicturePanel::Colors::Diverging,
                                      {}};
  const int zoom = std::max(1, 300 / std::max(1, std::max(xray.width, xray.height)));
  if (!is_body_alone) {
    write_picture({xray_panel, drr_panel, checker_panel, difference_panel}, 2, heading, path, zoom);
    return;
  }
  PicturePanel outline_panel = xray_panel;
  outline_panel.title = "X-ray and outline of the DRR";
  outline_panel.lines = outline(drr);
  write_picture({xray_panel, outline_panel, drr_panel, checker_panel, difference_panel},
                5,
                heading,
                path,
                zoom);
}

namespace {

/// Removes an earlier run's pose files, and writes the pose under names that say whether it was
/// found.
void write_pose_files(const RegistrationRecord& record, const std::filesystem::path& folder) {
  for (const char* name : {"pose.toml", "result.tfm", "rejected-pose.toml"})
    remove_output(folder / name);
  const RigidTransform& pose = record.result.room_from_ct;
  if (is_not_found(record)) {
    write_text_file(folder / "rejected-pose.toml",
                    "# Not found: " + judgement_of(record).reason + "\n" + pose_to_toml(pose));
    return;
  }
  write_text_file(folder / "pose.toml", pose_to_toml(pose));
  write_text_file(folder / "result.tfm", pose_to_itk_transform(pose));
}

/// A few lines for a person at the terminal.
std::string summary_text(const RegistrationRecord& record, const RegistrationProblem& problem) {
  const RegistrationResult& result = record.result;
  const PoseFrame frame = problem.frame();
  std::ostringstream out;
  out << "start       " << parameters_line(parameters_from_pose(frame, result.start_room_from_ct))
      << "   (rx, ry, rz, tx, ty, tz from nominal)\n"
      << "result      " << parameters_line(parameters_from_pose(frame, result.room_from_ct)) << '\n'
      << "similarity  " << fixed_text(result.similarity, 4) << '\n';
  if (std::isfinite(record.uncertainty.tre_95_mm))
    out << "uncertain   if it is right, TRE below " << fixed_text(record.uncertainty.tre_95_mm, 2)
        << " mm with 95 % (docs/uncertainty.md)\n";
  if (record.errors.has_value())
    out << "TRE         " << fixed_text(record.errors->initial_tre_mm, 2) << " mm at the start, "
        << fixed_text(record.errors->tre_mm, 2)
        << " mm at the end (gold pose: " << record.errors->gold_source << ")\n";
  if (result.correction.has_value())
    out << "corrected   " << correction_text(*result.correction) << '\n';
  out << "stopped     " << to_string(result.stop_reason);
  if (result.stop_reason == StopReason::StartInadmissible)
    out << " (" << result.rays_outside << " rays outside the field)";
  out << " after " << result.evaluations << " poses (" << result.inadmissible << " inadmissible), "
      << result.drr_count << " DRRs, " << fixed_text(result.seconds, 2) << " s\n";
  return out.str();
}

}  // namespace

void write_result_files(const RegistrationRecord& record,
                        const RegistrationProblem& problem,
                        const RunDescription& run,
                        const std::filesystem::path& folder) {
  write_pose_files(record, folder);
  const Verdict verdict = judgement_of(record).verdict;
  const std::string label =
      verdict == Verdict::Found ? "" : std::string(" (") + to_string(verdict) + ")";
  const std::vector<std::string> overlays = overlay_file_names(problem);
  for (std::size_t i = 0; i < overlays.size(); ++i)
    if (run.has_pictures)
      write_overlay(problem.views[i],
                    record.result.room_from_ct,
                    run.case_name + ", view " + problem.views[i].view.camera.name + label,
                    folder / overlays[i]);
    else
      remove_output(folder / overlays[i]);
  write_results_last(folder / "result.json", result_json(record, problem, run), run.provenance);
}

std::string write_run(const std::vector<RegistrationRecord>& records,
                      const RegistrationProblem& problem,
                      const RunDescription& run,
                      const std::filesystem::path& folder) {
  const RegistrationRecord& best = records[best_record(records)];
  // From here on, the results of an earlier run are incomplete.
  remove_output(folder / "result.json");
  std::ostringstream summary;
  const Judgement judgement = judgement_of(best);
  summary << "verdict     " << to_string(judgement.verdict) << ": " << judgement.reason << '\n'
          << "case " << run.case_name << ", renderer " << run.renderer << '\n';
  if (records.size() > 1) {
    write_text_file(folder / "registrations.csv",
                    registrations_table(records, problem, run).to_text());
    summary << records.size() << " starts (" << (folder / "registrations.csv").string()
            << "): " << counts_text(records) << "; highest similarity: start " << best.start_index
            << '\n';
  }
  write_result_files(best, problem, run, folder);
  summary << summary_text(best, problem) << "results     " << folder.string() << '\n';
  return summary.str();
}

std::vector<std::string> result_file_names() {
  return {"pose.toml",
          "result.tfm",
          "rejected-pose.toml",
          "result.json",
          "registrations.csv",
          "reproduce.sh"};
}

std::vector<std::string> overlay_file_names(const RegistrationProblem& problem) {
  std::vector<std::string> names;
  for (const RegistrationView& view : problem.views)
    names.push_back(file_name_part(view.view.camera.name) + "-overlay.png");
  return names;
}

}  // namespace af::registration
