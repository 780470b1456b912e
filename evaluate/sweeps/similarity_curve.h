// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "geometry/rigid_transform.h"

namespace af::evaluation {

/// The pose parameters in the order of every table; 0 to 2 are angles.
inline constexpr int kPoseParameters = 6;

/// Parameter `axis` at `offset` (deg or mm), the others zero.
PoseParameters along_axis(int axis, double offset);

/// -half_width, ..., 0, ..., half_width in steps of `step`, symmetric about an exact 0.
std::vector<double> curve_offsets(double half_width, double step);

/// Where a similarity curve is highest, and how broad it is there.
struct CurvePeak {
  double offset = 0.0;      ///< vertex of the parabola through the highest point and its neighbours
  double similarity = 0.0;  ///< of the highest point
  bool is_at_edge = false;  ///< the highest point is the first or last: the maximum may lie beyond
  /// Width at the level halfway between the highest value and `base`. NaN when the curve stays
  /// above it on one side.
  double width = 0.0;
};

/// Finds the peak of a curve with equal steps. NaN values (poses outside a field) are holes. Throws
/// InputError when no value is finite. \test CurvePeak.OfAParabolaIsItsVertex
CurvePeak find_peak(std::span<const double> offsets,
                    std::span<const double> similarity,
                    double base);

}  // namespace af::evaluation
