// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/yardstick.h"

#include "geometry/target_box.h"
#include "geometry/tre.h"

namespace af::evaluation {

Yardstick yardstick_of(const Study& study, const StudyCase& study_case, const GoldStandard& gold) {
  Yardstick yardstick;
  yardstick.gold_room_from_ct = gold.room_from_ct;
  yardstick.gold_frame = PoseFrame::about(gold.room_from_ct, study_case.center_ct_mm);
  if (gold.source == "fiducials") {
    yardstick.stated_pose = gold.stated_pose;
    if (gold.uncertainty.has_value()) yardstick.gold_tre_95_mm = gold.uncertainty->p95_tre_mm;
  }
  yardstick.points_ct_mm = target_points(study_case.target_box_ct);
  yardstick.center_ct_mm = study_case.center_ct_mm;
  yardstick.rig.isocenter_point = study.rig.isocenter_point;
  for (const StudyView& view : study_case.views)
    yardstick.rig.cameras.push_back(study.rig.camera(view.camera));
  return yardstick;
}

void measure_pose(const RigidTransform& room_from_ct,
                  const Yardstick& yardstick,
                  RegistrationRow& row) {
  row.final_deg_mm = parameters_from_pose(yardstick.gold_frame, room_from_ct).deg_and_mm();
  row.tre_mm = mean_tre_mm(room_from_ct, yardstick.gold_room_from_ct, yardstick.points_ct_mm);
  row.errors = registration_errors(room_from_ct,
                                   yardstick.gold_room_from_ct,
                                   yardstick.points_ct_mm,
                                   yardstick.center_ct_mm,
                                   yardstick.rig);
  row.gold_tre_95_mm = yardstick.gold_tre_95_mm;
  if (yardstick.stated_pose.has_value())
    row.stated_pose_tre_mm =
        mean_tre_mm(room_from_ct, *yardstick.stated_pose, yardstick.points_ct_mm);
}

}  // namespace af::evaluation
