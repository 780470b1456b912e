// SPDX-License-Identifier: Apache-2.0
#include "register/target_errors_program.h"

#include <optional>
#include <string>

#include "evaluate/fiducial_registration.h"
#include "evaluate/target_box.h"
#include "evaluate/tre.h"

namespace af::registration {
namespace {

struct GoldPose {
  RigidTransform room_from_ct;
  std::string source;
};

/// The gold standard of the case's fiducials, or the pose the study states; none when it has
/// neither.
std::optional<GoldPose> gold_pose(const Study& study, const StudyCase& study_case) {
  std::vector<evaluation::FiducialView> views;
  for (const StudyView& view : study_case.views)
    if (!view.fiducials_px.empty())
      views.push_back({study.rig.camera(view.camera), view.fiducials_px});
  if (!study_case.fiducials_ct_mm.empty() && views.size() >= 2)
    return GoldPose{evaluation::gold_from_fiducials(views, study_case.fiducials_ct_mm).room_from_ct,
                    "fiducials"};
  if (study_case.gold_room_from_ct.has_value())
    return GoldPose{*study_case.gold_room_from_ct, "gold_room_from_ct"};
  return std::nullopt;
}

}  // namespace

void add_target_errors(const Study& study,
                       const StudyCase& study_case,
                       std::vector<RegistrationRecord>& records) {
  const std::optional<GoldPose> gold = gold_pose(study, study_case);
  if (!gold.has_value()) return;
  const std::vector<Eigen::Vector3d> points = evaluation::target_points(study_case.target_box_ct);
  for (RegistrationRecord& record : records)
    record.errors = TargetErrors{
        gold->source,
        evaluation::mean_tre_mm(record.result.start_room_from_ct, gold->room_from_ct, points),
        evaluation::mean_tre_mm(record.result.room_from_ct, gold->room_from_ct, points)};
}

}  // namespace af::registration
