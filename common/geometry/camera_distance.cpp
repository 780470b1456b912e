// SPDX-License-Identifier: Apache-2.0
#include "geometry/camera_distance.h"

#include <algorithm>
#include <iomanip>
#include <sstream>

#include "geometry/rigid_transform.h"

namespace af {

namespace {

/// Files state the geometry of cameras and fields less precisely than this.
constexpr double kSameMm = 1e-3;

RigidTransform room_from_camera(const CameraGeometry& camera) {
  Eigen::Matrix3d axes;
  axes.col(0) = camera.column_direction;
  axes.col(1) = camera.row_direction;
  axes.col(2) = camera.column_direction.cross(camera.row_direction);
  RigidTransform result = RigidTransform::Identity();
  result.linear() = axes;
  return result;
}

}  // namespace

bool CameraDistance::is_none() const {
  return source_mm <= kSameMm && detector_mm <= kSameMm && !has_other_pixels;
}

std::string CameraDistance::text() const {
  if (is_none()) return "the nominal camera";
  std::ostringstream out;
  out << std::fixed << std::setprecision(2) << "source " << source_mm << " mm, rotation "
      << rotation_deg << " deg, source to detector " << std::showpos << source_detector_mm
      << std::noshowpos << " mm, detector corners " << detector_mm << " mm";
  if (has_other_pixels) out << ", other pixels";
  out << " from the nominal camera";
  return out.str();
}

CameraDistance camera_distance(const CameraGeometry& camera, const CameraGeometry& nominal) {
  constexpr double kSameSpacing = 1e-6;
  CameraDistance distance;
  distance.source_mm = (camera.source_point - nominal.source_point).norm();
  distance.rotation_deg =
      rotation_angle_between_rad(room_from_camera(nominal), room_from_camera(camera)) * kDegPerRad;
  distance.source_detector_mm =
      camera.source_detector_distance_mm() - nominal.source_detector_distance_mm();
  const auto corners = camera.detector_corner_points();
  const auto nominal_corners = nominal.detector_corner_points();
  for (std::size_t i = 0; i < corners.size(); ++i)
    distance.detector_mm = std::max(distance.detector_mm, (corners[i] - nominal_corners[i]).norm());
  distance.has_other_pixels =
      camera.size_px != nominal.size_px ||
      !camera.pixel_spacing_mm.isApprox(nominal.pixel_spacing_mm, kSameSpacing);
  return distance;
}

}  // namespace af
