// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "geometry/rigid_transform.h"

namespace af {

/// Target registration error (mm): the mean over the target points of the distance between where
/// two poses put them, mean |room_from_ct x - gold x| = mean |dR x + dt|. NaN when a pose has
/// values that are not finite. Throws InputError without points.
/// \test MeanTre.OfATranslationIsItsLength
double mean_tre_mm(const RigidTransform& room_from_ct,
                   const RigidTransform& gold_room_from_ct,
                   std::span<const Eigen::Vector3d> points_ct_mm);

struct TreBounds {
  double low_mm = 0.0;
  double high_mm = 0.0;
};

/// Bounds mean_tre_mm() from cells of points, without a pass over all points: below by the distance
/// at each cell's mean (Jensen), above by its root mean square distance. With four cells along each
/// axis the bounds lie within a few percent; more cells are tighter and slower. For a pure
/// translation the bounds coincide. \test MeanTre.LiesWithinItsBounds
class TreBounder {
 public:
  /// Throws InputError without points.
  explicit TreBounder(std::span<const Eigen::Vector3d> points_ct_mm, int cells_per_axis = 4);

  [[nodiscard]] TreBounds bounds(const RigidTransform& room_from_ct,
                                 const RigidTransform& gold_room_from_ct) const;

 private:
  struct Cell {
    double share = 0.0;  ///< of all points
    Eigen::Vector3d mean_mm = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance_mm2 = Eigen::Matrix3d::Zero();
  };
  std::vector<Cell> cells_;
};

}  // namespace af
