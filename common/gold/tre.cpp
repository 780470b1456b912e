// SPDX-License-Identifier: Apache-2.0
#include "gold/tre.h"

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

}  // namespace af
