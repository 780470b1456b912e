// SPDX-License-Identifier: Apache-2.0
#include "geometry/point_distances.h"

#include <cstdint>

#include "base/sample_summary.h"
#include "base/vector_width.h"
#include "geometry/point_distances_kernel.h"

namespace af {
namespace {

static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double), "kernels read points as numbers");

PointMap map_of(const Eigen::Matrix3d& matrix, const Eigen::Vector3d& offset) {
  PointMap map{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) map.matrix[row][column] = matrix(row, column);
    map.offset[row] = offset[row];
  }
  return map;
}

/// Maps the ct frame to columns, rows and depth of a camera with its source at the origin.
PointMap camera_from_ct(const CameraGeometry& camera, const RigidTransform& room_from_ct) {
  Eigen::Matrix3d axes;
  axes << camera.column_direction.transpose(), camera.row_direction.transpose(),
      camera.beam_direction().transpose();
  return map_of(axes * room_from_ct.linear(),
                axes * (room_from_ct.translation() - camera.source_point));
}

}  // namespace

double sum_of_lengths_mm(std::span<const Eigen::Vector3d> points_ct_mm,
                         const Eigen::Matrix3d& matrix,
                         const Eigen::Vector3d& offset_mm) {
  if (points_ct_mm.empty()) return 0.0;
  const auto sum = select_kernel<SumLengths*>(
      kernels_128::sum_lengths, kernels_256::sum_lengths, kernels_512::sum_lengths);
  return sum(points_ct_mm.front().data(),
             static_cast<std::int64_t>(points_ct_mm.size()),
             map_of(matrix, offset_mm));
}

ProjectionDistances projection_distances(const CameraGeometry& camera,
                                         std::span<const Eigen::Vector3d> points_ct_mm,
                                         const RigidTransform& room_from_ct,
                                         const RigidTransform& gold_room_from_ct) {
  if (points_ct_mm.empty()) return {};
  const auto sum = select_kernel<SumProjections*>(
      kernels_128::sum_projections, kernels_256::sum_projections, kernels_512::sum_projections);
  const ProjectionSums sums = sum(points_ct_mm.front().data(),
                                  static_cast<std::int64_t>(points_ct_mm.size()),
                                  camera_from_ct(camera, room_from_ct),
                                  camera_from_ct(camera, gold_room_from_ct));
  if (!(sums.smallest_depth > 0.0)) return {kNan, kNan};
  return {sums.reprojection, sums.slope * camera.source_detector_distance_mm()};
}

}  // namespace af
