// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/registration_errors.h"

#include <cmath>

#include "base/error.h"
#include "geometry/point_distances.h"
#include "geometry/target_box.h"

namespace af::evaluation {

using Eigen::Vector3d;

RegistrationErrors registration_errors(const RigidTransform& room_from_ct,
                                       const RigidTransform& gold_room_from_ct,
                                       std::span<const Vector3d> points_ct_mm,
                                       const Vector3d& center_ct_mm,
                                       const CameraRig& rig) {
  if (points_ct_mm.empty()) throw InputError("target points: there must be at least one");
  if (rig.cameras.empty()) throw InputError("projection errors: there must be a camera");
  RegistrationErrors errors;
  errors.rotation_deg = rotation_angle_between_rad(gold_room_from_ct, room_from_ct) * kDegPerRad;
  errors.translation_mm = (room_from_ct * center_ct_mm - gold_room_from_ct * center_ct_mm).norm();
  double reprojection_mm = 0.0;
  double detector_mm = 0.0;
  double isocenter_mm = 0.0;
  for (const CameraGeometry& camera : rig.cameras) {
    // The planes are parallel, so distances on them are in proportion to their depths.
    const double demagnification =
        camera.depth_mm(rig.isocenter_point) / camera.source_detector_distance_mm();
    const ProjectionDistances sums =
        projection_distances(camera, points_ct_mm, room_from_ct, gold_room_from_ct);
    reprojection_mm += sums.reprojection_mm;
    detector_mm += sums.detector_mm;
    isocenter_mm += sums.detector_mm * demagnification;
  }
  const auto count = static_cast<double>(rig.cameras.size() * points_ct_mm.size());
  errors.mrpd_mm = reprojection_mm / count;
  errors.projection_detector_mm = detector_mm / count;
  errors.projection_isocenter_mm = isocenter_mm / count;
  if (rig.cameras.size() == 1) {
    const Vector3d target_ct_mm = mean_point(points_ct_mm);
    const Vector3d gold_mm = gold_room_from_ct * target_ct_mm;
    const Vector3d beam = (gold_mm - rig.cameras.front().source_point).normalized();
    errors.depth_mm = std::abs((room_from_ct * target_ct_mm - gold_mm).dot(beam));
  }
  return errors;
}

}  // namespace af::evaluation
