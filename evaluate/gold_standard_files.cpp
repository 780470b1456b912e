// SPDX-License-Identifier: Apache-2.0
#include "evaluate/gold_standard_files.h"

#include <algorithm>

#include "base/error.h"
#include "evaluate/summary_files.h"
#include "evaluate/target_box.h"
#include "evaluate/tre.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

std::optional<FiducialGold> fiducial_gold(const Study& study, const StudyCase& study_case) {
  std::vector<FiducialView> views;
  for (const StudyView& view : study_case.views)
    if (!view.fiducials_px.empty())
      views.push_back({study.rig.camera(view.camera), view.fiducials_px});
  if (study_case.fiducials_ct_mm.empty() || views.size() < 2) return std::nullopt;
  return gold_from_fiducials(views, study_case.fiducials_ct_mm);
}

}  // namespace

GoldStandard gold_standard(const Study& study,
                           const StudyCase& study_case,
                           const std::string& choice) {
  GoldStandard gold;
  gold.fiducials = fiducial_gold(study, study_case);
  gold.stated_pose = study_case.gold_room_from_ct;
  if (gold.fiducials.has_value() && gold.stated_pose.has_value())
    gold.stated_to_fiducials_mm = mean_tre_mm(
        gold.fiducials->room_from_ct, *gold.stated_pose, target_points(study_case.target_box_ct));
  const bool uses_fiducials =
      choice == "fiducials" || (choice == "auto" && gold.fiducials.has_value());
  if (uses_fiducials ? !gold.fiducials.has_value() : !gold.stated_pose.has_value())
    throw InputError("gold",
                     choice,
                     "case '" + study_case.name + "' has " +
                         (choice == "fiducials" ? "no fiducials seen in two views"
                          : choice == "study"   ? "no gold_room_from_ct"
                                                : "neither fiducials seen in two views nor "
                                                  "gold_room_from_ct"),
                     study.path.string());
  gold.room_from_ct = uses_fiducials ? gold.fiducials->room_from_ct : *gold.stated_pose;
  gold.source = uses_fiducials ? "fiducials" : "study";
  return gold;
}

json to_json(const GoldStandard& gold) {
  json result = {{"source", gold.source}};
  if (gold.fiducials.has_value()) {
    json gaps = json::array();
    for (const BackProjection& point : gold.fiducials->back_projections)
      gaps.push_back(point.ray_gap_mm);
    result["fre_mm"] = gold.fiducials->fit.fre_mm;
    result["residuals_mm"] = gold.fiducials->fit.residuals_mm;
    result["ray_gaps_mm"] = gaps;
  }
  if (gold.stated_to_fiducials_mm.has_value())
    result["stated_to_fiducials_mm"] = *gold.stated_to_fiducials_mm;
  return result;
}

}  // namespace af::evaluation
