// SPDX-License-Identifier: Apache-2.0
#include "gold/tre.h"

#include <cmath>

#include "base/error.h"

namespace af {

double mean_tre_mm(const RigidTransform& room_from_ct,
                   const RigidTransform& gold_room_from_ct,
                   std::span<const Eigen::Vector3d> points_ct_mm) {
  if (points_ct_mm.empty()) throw InputError("target points: there must be at least one");
  const Eigen::Matrix3d rotation_difference = room_from_ct.linear() - gold_room_from_ct.linear();
  const Eigen::Vector3d translation_difference =
      room_from_ct.translation() - gold_room_from_ct.translation();
  double sum_mm = 0.0;
  for (const Eigen::Vector3d& point : points_ct_mm)
    sum_mm += (rotation_difference * point + translation_difference).norm();
  return sum_mm / static_cast<double>(points_ct_mm.size());
}

PointMoments point_moments(std::span<const Eigen::Vector3d> points_ct_mm) {
  if (points_ct_mm.empty()) throw InputError("target points: there must be at least one");
  const double count = static_cast<double>(points_ct_mm.size());
  PointMoments moments;
  for (const Eigen::Vector3d& point : points_ct_mm) moments.mean += point;
  moments.mean /= count;
  for (const Eigen::Vector3d& point : points_ct_mm)
    moments.covariance += (point - moments.mean) * (point - moments.mean).transpose();
  moments.covariance /= count;
  return moments;
}

TreBounds mean_tre_bounds_mm(const RigidTransform& room_from_ct,
                             const RigidTransform& gold_room_from_ct,
                             const PointMoments& moments) {
  // Far above the rounding of a mean over any number of points, far below what matters.
  constexpr double kRounding = 1e-9;
  const Eigen::Matrix3d rotation_difference = room_from_ct.linear() - gold_room_from_ct.linear();
  const double low_mm = (rotation_difference * moments.mean + room_from_ct.translation() -
                         gold_room_from_ct.translation())
                            .norm();
  const double spread_mm2 =
      (rotation_difference * moments.covariance * rotation_difference.transpose()).trace();
  return {low_mm * (1.0 - kRounding), std::sqrt(low_mm * low_mm + spread_mm2) * (1.0 + kRounding)};
}

}  // namespace af
