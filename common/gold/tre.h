// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "geometry/rigid_transform.h"

namespace af {

/// Target registration error (mm): the mean over the target points of the distance between where
/// two poses put them, mean |room_from_ct x - gold x| = mean |dR x + dt|. NaN when a pose has
/// values that are not finite. Throws InputError without points.
/// \test MeanTre.OfATranslationIsItsLength
double mean_tre_mm(const RigidTransform& room_from_ct,
                   const RigidTransform& gold_room_from_ct,
                   std::span<const Eigen::Vector3d> points_ct_mm);

/// Mean and covariance of target points (ct frame, mm).
struct PointMoments {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};
/// Throws InputError without points.
PointMoments point_moments(std::span<const Eigen::Vector3d> points_ct_mm);

/// Bounds of mean_tre_mm() that need no pass over the points: the distance at their mean below
/// (Jensen), the root mean square distance above; both are one for a pure translation.
/// \test MeanTre.LiesWithinItsBounds
struct TreBounds {
  double low_mm = 0.0;
  double high_mm = 0.0;
};
TreBounds mean_tre_bounds_mm(const RigidTransform& room_from_ct,
                             const RigidTransform& gold_room_from_ct,
                             const PointMoments& moments);

}  // namespace af
