// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af {

/// Sum of |matrix x + offset_mm| over points (mm).
double sum_of_lengths_mm(std::span<const Eigen::Vector3d> points_ct_mm,
                         const Eigen::Matrix3d& matrix,
                         const Eigen::Vector3d& offset_mm);

/// How far apart two poses put the points as one camera sees them, summed over points. NaN when a
/// point lies behind the source.
struct ProjectionDistances {
  double reprojection_mm = 0.0;  ///< from the gold point to the line through source and point
  double detector_mm = 0.0;      ///< between both projections on the detector
};
ProjectionDistances projection_distances(const CameraGeometry& camera,
                                         std::span<const Eigen::Vector3d> points_ct_mm,
                                         const RigidTransform& room_from_ct,
                                         const RigidTransform& gold_room_from_ct);

}  // namespace af
