// SPDX-License-Identifier: Apache-2.0
#include "geometry/tre.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "base/error.h"
#include "geometry/point_distances.h"

namespace af {

double mean_tre_mm(const RigidTransform& room_from_ct,
                   const RigidTransform& gold_room_from_ct,
                   std::span<const Eigen::Vector3d> points_ct_mm) {
  if (points_ct_mm.empty()) throw InputError("target points: there must be at least one");
  return sum_of_lengths_mm(points_ct_mm,
                           room_from_ct.linear() - gold_room_from_ct.linear(),
                           room_from_ct.translation() - gold_room_from_ct.translation()) /
         static_cast<double>(points_ct_mm.size());
}

TreBounder::TreBounder(std::span<const Eigen::Vector3d> points_ct_mm, int cells_per_axis) {
  check(cells_per_axis >= 1, "there must be a cell");
  if (points_ct_mm.empty()) throw InputError("target points: there must be at least one");
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : points_ct_mm) box.extend(point);
  const auto per_axis = static_cast<std::size_t>(cells_per_axis);
  const Eigen::Vector3d cell_mm = (box.sizes() / cells_per_axis).cwiseMax(1e-9);
  cells_.resize(per_axis * per_axis * per_axis);
  const Eigen::Vector3d center = box.center();
  for (const Eigen::Vector3d& point : points_ct_mm) {
    const Eigen::Vector3d place = (point - box.min()).cwiseQuotient(cell_mm);
    std::size_t index = 0;
    for (const double along : {place.z(), place.y(), place.x()})
      index = index * per_axis + std::min(static_cast<std::size_t>(along), per_axis - 1);
    Cell& cell = cells_[index];
    cell.share += 1.0;
    cell.mean_mm += point - center;
    cell.covariance_mm2 += (point - center) * (point - center).transpose();
  }
  std::erase_if(cells_, [](const Cell& cell) { return cell.share == 0.0; });
  for (Cell& cell : cells_) {
    cell.mean_mm /= cell.share;
    cell.covariance_mm2 =
        cell.covariance_mm2 / cell.share - cell.mean_mm * cell.mean_mm.transpose();
    cell.mean_mm += center;
    cell.share /= static_cast<double>(points_ct_mm.size());
  }
}

TreBounds TreBounder::bounds(const RigidTransform& room_from_ct,
                             const RigidTransform& gold_room_from_ct) const {
  const Eigen::Matrix3d turn = room_from_ct.linear() - gold_room_from_ct.linear();
  const Eigen::Vector3d shift_mm = room_from_ct.translation() - gold_room_from_ct.translation();
  const Eigen::Matrix3d squared_turn = turn.transpose() * turn;
  TreBounds bounds;
  for (const Cell& cell : cells_) {
    const double squared_mm2 = (turn * cell.mean_mm + shift_mm).squaredNorm();
    // The trace of turn * covariance * turn^T; rounding may make it negative.
    const double spread_mm2 = std::max(0.0, squared_turn.cwiseProduct(cell.covariance_mm2).sum());
    bounds.low_mm += cell.share * std::sqrt(squared_mm2);
    bounds.high_mm += cell.share * std::sqrt(squared_mm2 + spread_mm2);
  }
  // This is far above the rounding of a mean over any number of points, and far below what matters.
  constexpr double kRounding = 1e-9;
  return {bounds.low_mm * (1.0 - kRounding), bounds.high_mm * (1.0 + kRounding)};
}

}  // namespace af
