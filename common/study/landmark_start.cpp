// SPDX-License-Identifier: Apache-2.0
#include "study/landmark_start.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "files/csv_table.h"

namespace af {
namespace {

bool shows_one(const StudyView& view) {
  return std::ranges::any_of(view.landmarks_px,
                             [](const auto& point) { return point.has_value(); });
}

/// What a residual means for a start: how well the marks agree on one pose, in mm at their places.
std::string marks_verdict(const LandmarkPose& pose, const StudyCase& study_case) {
  /// A registration this near counts as a success.
  constexpr double kSuccessMm = 2.5;
  /// Most registrations succeed from starts this far off (docs/howto/bones.md, docs/population.md).
  constexpr double kStartMm = 10.0;
  if (pose.rms_mm <= kSuccessMm)
    return "good: within the 2.5 mm that count as a successful registration";
  if (pose.rms_mm <= kStartMm)
    return "rough: beyond the 2.5 mm that count as a successful registration, but within the 10 mm "
           "from which most succeed";
  const LandmarkResidual& worst =
      *std::ranges::max_element(pose.residuals, {}, &LandmarkResidual::mm);
  return "bad: beyond the 10 mm from which most registrations succeed; look at the marks again, " +
         study_case.views[worst.view].camera + " #" + std::to_string(worst.landmark + 1) +
         " first: the same point in CT and X-ray, LPS mm, (column, row)?";
}

}  // namespace

bool has_landmarks(const StudyCase& study_case) {
  return std::ranges::any_of(study_case.views, shows_one);
}

LandmarkPose landmark_pose(const CameraRig& rig, const StudyCase& study_case) {
  if (!has_landmarks(study_case))
    throw InputError("has no landmarks_ct_mm with landmarks_px to start from");
  std::vector<LandmarkView> views;
  for (const StudyView& view : study_case.views) {
    std::vector<std::optional<Eigen::Vector2d>> seen = view.landmarks_px;
    seen.resize(study_case.landmarks_ct_mm.size());
    views.push_back({rig.camera(view.camera), seen});
  }
  return pose_from_landmarks(views, study_case.landmarks_ct_mm, study_case.nominal_room_from_ct);
}

LandmarkPose landmark_pose(const Study& study, const StudyCase& study_case) {
  try {
    return landmark_pose(study.rig, study_case);
  } catch (const InputError& error) {
    throw InputError(study.path.string() + ": case '" + study_case.name + "': " + error.what());
  }
}

std::string residuals_text(const LandmarkPose& pose, const StudyCase& study_case) {
  std::string text =
      "landmarks   " + fixed_text(pose.rms_px, 1) + " px, " + fixed_text(pose.rms_mm, 2) +
      " mm from where they were seen (RMS): " + marks_verdict(pose, study_case) + "\n           ";
  for (const LandmarkResidual& residual : pose.residuals)
    text += " " + study_case.views[residual.view].camera + " #" +
            std::to_string(residual.landmark + 1) + " " + fixed_text(residual.px, 1) + " px, " +
            fixed_text(residual.mm, 2) + " mm;";
  text.back() = '\n';
  for (const std::string& note : pose.notes) text += "            " + note + "\n";
  return text;
}

nlohmann::json to_json(const LandmarkPose& pose, const StudyCase& study_case) {
  nlohmann::json output = {{"rms_px", pose.rms_px},
                           {"rms_mm", pose.rms_mm},
                           {"notes", pose.notes},
                           {"residuals", nlohmann::json::array()}};
  for (const LandmarkResidual& residual : pose.residuals)
    output["residuals"].push_back({{"camera", study_case.views[residual.view].camera},
                                   {"landmark", residual.landmark + 1},
                                   {"px", residual.px},
                                   {"mm", residual.mm}});
  return output;
}

}  // namespace af
