// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// y = matrix x + offset, row by row.
struct PointMap {
  double matrix[3][3];
  double offset[3];
};

/// Sum of |map(x)| over `count` points (x, y, z one after the other). It is added in eight parts,
/// so that every vector width gives identical bits.
using SumLengths = double(const double* points, int64_t count, const PointMap& map);

/// What points contribute in one camera.
struct ProjectionSums {
  double reprojection;    ///< distance from the gold point to the line through source and point
  double slope;           ///< distance between both projections on a detector at depth 1
  double smallest_depth;  ///< over all points and gold points
};

/// The maps lead into the camera's frame: source at the origin, depth along z.
using SumProjections = ProjectionSums(const double* points,
                                      int64_t count,
                                      const PointMap& camera_from_ct,
                                      const PointMap& gold_camera_from_ct);

namespace kernels_128 {
SumLengths sum_lengths;
SumProjections sum_projections;
}  // namespace kernels_128
namespace kernels_256 {
SumLengths sum_lengths;
SumProjections sum_projections;
}  // namespace kernels_256
namespace kernels_512 {
SumLengths sum_lengths;
SumProjections sum_projections;
}  // namespace kernels_512

}  // namespace af
