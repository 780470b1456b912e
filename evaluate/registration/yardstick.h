// SPDX-License-Identifier: Apache-2.0
// What poses are measured against, the same for our own registrations and for other programs'
// poses.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "evaluate/registration/registration_rows.h"
#include "geometry/camera_geometry.h"
#include "study/case_gold_standard.h"
#include "study/study_file.h"

namespace af::evaluation {

/// The gold pose of one case, and everything that defines errors.
struct Yardstick {
  PoseFrame gold_frame;
  RigidTransform gold_room_from_ct = RigidTransform::Identity();
  double gold_tre_95_mm = 0.0;                ///< 95 % quantile of the gold standard's own TRE
  std::optional<RigidTransform> stated_pose;  ///< only where fiducials give the gold
  std::vector<Eigen::Vector3d> points_ct_mm;
  Eigen::Vector3d center_ct_mm = Eigen::Vector3d::Zero();  ///< c_roi
  CameraRig rig;                                           ///< the cameras of the case's views

  [[nodiscard]] bool has_one_view() const { return rig.cameras.size() == 1; }

  /// The pose of parameters as rows have them.
  [[nodiscard]] RigidTransform pose_of(const std::array<double, 6>& deg_mm) const {
    return pose_from_parameters(gold_frame, PoseParameters::from_deg_and_mm(deg_mm));
  }
};

Yardstick yardstick_of(const Study& study, const StudyCase& study_case, const GoldStandard& gold);

/// Writes the final parameters and all errors of a pose into its row.
void measure_pose(const RigidTransform& room_from_ct,
                  const Yardstick& yardstick,
                  RegistrationRow& row);

}  // namespace af::evaluation
