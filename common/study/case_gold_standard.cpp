// SPDX-License-Identifier: Apache-2.0
#include "study/case_gold_standard.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "files/number_json.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"

namespace af {

using nlohmann::json;

namespace {

// The Monte Carlo estimate must not change with the seed of the starts.
constexpr std::uint64_t kUncertaintySeed = 1;

// The cells of the target box for the estimate. They take a thousandth of the work of 1 mm voxels.
// The mean distance of a rigid motion over a cell is that at its centre, up to second order in
// angle times cell.
constexpr double kUncertaintySpacingMm = 6.0;

std::vector<FiducialView> fiducial_views(const Study& study, const StudyCase& study_case) {
  std::vector<FiducialView> views;
  for (const StudyView& view : study_case.views)
    if (!view.fiducials_px.empty())
      views.push_back({study.rig.camera(view.camera), view.fiducials_px});
  return views;
}

void add_fiducial_gold(const Study& study, const StudyCase& study_case, GoldStandard& gold) {
  if (!has_fiducial_gold(study, study_case)) return;
  const std::vector<FiducialView> views = fiducial_views(study, study_case);
  gold.fiducials = gold_from_fiducials(views, study_case.fiducials_ct_mm);
  gold.uncertainty =
      gold_uncertainty(*gold.fiducials,
                       views,
                       study_case.fiducials_ct_mm,
                       target_points(study_case.target_box_ct, kUncertaintySpacingMm),
                       kUncertaintySeed);
}

double rms(const std::vector<double>& values) {
  double squares = 0.0;
  for (const double value : values) squares += value * value;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

json to_json(const GoldUncertainty& uncertainty) {
  return {{"detection_sigma_px", uncertainty.detection_sigma_px},
          {"degrees_of_freedom", uncertainty.degrees_of_freedom},
          {"replicates", uncertainty.replicates},
          {"mean_tre_mm", number_json(uncertainty.mean_tre_mm)},
          {"rms_tre_mm", number_json(uncertainty.rms_tre_mm)},
          {"p95_tre_mm", number_json(uncertainty.p95_tre_mm)}};
}

}  // namespace

bool has_fiducial_gold(const Study& study, const StudyCase& study_case) {
  const std::vector<FiducialView> views = fiducial_views(study, study_case);
  return fiducials_in_two_views(views, study_case.fiducials_ct_mm.size()).size() >=
         kFewestFiducials;
}

void require_gold(const Study& study, const StudyCase& study_case, const std::string& choice) {
  const std::string source = gold_source(study, study_case);
  if (choice == "auto" ? source != "none"
                       : source == choice || (choice == "study" && study_case.gold_room_from_ct))
    return;
  throw InputError("gold",
                   choice,
                   "case '" + study_case.name + "' has " +
                       (choice == "fiducials" ? "no three fiducials that two views show"
                        : choice == "study"   ? "no gold_room_from_ct"
                                              : "neither three fiducials that two views show nor "
                                                "gold_room_from_ct: state either, or register it "
                                                "with af-register, which needs neither"),
                   study.path.string());
}

std::string gold_source(const Study& study, const StudyCase& study_case) {
  if (has_fiducial_gold(study, study_case)) return "fiducials";
  return study_case.gold_room_from_ct.has_value() ? "study" : "none";
}

GoldStandard gold_standard(const Study& study,
                           const StudyCase& study_case,
                           const std::string& choice) {
  require_gold(study, study_case, choice);
  GoldStandard gold;
  add_fiducial_gold(study, study_case, gold);
  gold.stated_pose = study_case.gold_room_from_ct;
  if (gold.fiducials.has_value() && gold.stated_pose.has_value())
    gold.stated_to_fiducials_mm = mean_tre_mm(
        gold.fiducials->room_from_ct, *gold.stated_pose, target_points(study_case.target_box_ct));
  gold.source = choice == "auto" ? gold_source(study, study_case) : choice;
  gold.room_from_ct = gold.source == "fiducials" ? gold.fiducials->room_from_ct : *gold.stated_pose;
  return gold;
}

std::optional<GoldStandard> known_gold(const Study& study, const StudyCase& study_case) {
  if (gold_source(study, study_case) == "none") return std::nullopt;
  return gold_standard(study, study_case, "auto");
}

double own_tre_mm(const GoldStandard& gold) {
  return gold.source == "fiducials" && gold.uncertainty.has_value()
             ? gold.uncertainty->mean_tre_mm
             : std::numeric_limits<double>::quiet_NaN();
}

json to_json(const GoldStandard& gold) {
  json result = {{"source", gold.source}};
  if (gold.fiducials.has_value()) {
    json gaps = json::array();
    for (const BackProjection& point : gold.fiducials->back_projections)
      gaps.push_back(point.ray_gap_mm);
    result["fiducials_used"] = gold.fiducials->used;
    result["fre_mm"] = gold.fiducials->fit.fre_mm;
    result["residuals_mm"] = gold.fiducials->fit.residuals_mm;
    result["ray_gaps_mm"] = gaps;
    const std::vector<double>& left_out_mm = gold.fiducials->leave_one_out_mm;
    result["leave_one_out_mm"] = left_out_mm;
    result["leave_one_out_rms_mm"] = left_out_mm.empty() ? json(nullptr) : json(rms(left_out_mm));
    result["uncertainty"] = to_json(*gold.uncertainty);
  }
  if (gold.stated_to_fiducials_mm.has_value())
    result["stated_to_fiducials_mm"] = *gold.stated_to_fiducials_mm;
  return result;
}

}  // namespace af
