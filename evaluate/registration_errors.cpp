// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration_errors.h"

#include <cmath>

#include "base/error.h"
#include "geometry/point_projector.h"

namespace af::evaluation {
namespace {

using Eigen::Vector3d;

/// What one point contributes in one camera.
struct PointErrors {
  double reprojection_mm = 0.0;
  double detector_mm = 0.0;
};

PointErrors point_errors(const PointProjector& projector,
                         const Vector3d& point,
                         const Vector3d& gold_point) {
  const CameraGeometry& camera = projector.camera();
  if (!(projector.depth_mm(point) > 0.0 && projector.depth_mm(gold_point) > 0.0))
    return {RegistrationErrors::kMissing, RegistrationErrors::kMissing};
  const Vector3d direction = (point - camera.source_point).normalized();
  const Eigen::Vector2d shift_px = projector.project(point) - projector.project(gold_point);
  return {(gold_point - camera.source_point).cross(direction).norm(),
          shift_px.cwiseProduct(camera.pixel_spacing_mm).norm()};
}

}  // namespace

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
    // Parallel planes: distances on them are as their depths.
    const double demagnification =
        camera.depth_mm(rig.isocenter_point) / camera.source_detector_distance_mm();
    const PointProjector projector(camera);
    for (const Vector3d& point_ct : points_ct_mm) {
      const PointErrors point =
          point_errors(projector, room_from_ct * point_ct, gold_room_from_ct * point_ct);
      reprojection_mm += point.reprojection_mm;
      detector_mm += point.detector_mm;
      isocenter_mm += point.detector_mm * demagnification;
    }
  }
  const auto count = static_cast<double>(rig.cameras.size() * points_ct_mm.size());
  errors.mrpd_mm = reprojection_mm / count;
  errors.projection_detector_mm = detector_mm / count;
  errors.projection_isocenter_mm = isocenter_mm / count;
  return errors;
}

}  // namespace af::evaluation
