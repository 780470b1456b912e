// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <span>

#include "base/thread_pool.h"
#include "ct/attenuation_volume.h"

namespace af {

/// A fan of rays from one point to a regular grid of points, in the ct frame (mm): a DRR, or one
/// viewpoint of a field. Ray (column, row) runs from `source_point` through first_point + column *
/// column_step + row * row_step and beyond.
struct RayFan {
  Eigen::Vector3d source_point;
  Eigen::Vector3d first_point;
  Eigen::Vector3d column_step;
  Eigen::Vector3d row_step;
  int columns = 0;
  int rows = 0;
  /// The part of every ray that counts, in multiples of the way from source to grid point. It is a
  /// layer between two planes parallel to the grid's.
  double begin = 0.0;
  double end = std::numeric_limits<double>::infinity();
};

/// Request for derivatives of a fan's values by motions of the volume: six planes of columns * rows
/// values, dU per rad of rotation about the axes through the pivot, then dU per mm along them.
struct MotionSlopes {
  Eigen::Vector3d pivot_ct_point = Eigen::Vector3d::Zero();
  Eigen::Matrix3d ct_axes = Eigen::Matrix3d::Identity();  ///< columns: unit vectors
  std::span<float> planes;
};

struct RayCasterOptions {
  double step_mm = 1.0;  ///< largest distance between samples along a ray

  void describe(Fields& field);
};

std::vector<std::string> problems(const RayCasterOptions& options);

/// The reference caster: total attenuation of eq. (1). It takes trilinear samples at the midpoints
/// of equal steps not longer than step_mm, over the ray's whole path through the volume, from the
/// source on. A source inside the volume starts there. Values are bit-identical for every vector
/// width. Re-entrant. \test RayCaster.UniformBoxGivesMuTimesChordLength
class RayCaster {
 public:
  RayCaster(const AttenuationVolume& volume, const RayCasterOptions& options);

  /// Writes U of every ray of the fan into `total_attenuation` (columns * rows values):
  /// dimensionless, row-major, exactly 0 where a ray misses the volume. Threads of `pool` share the
  /// rows, when one is given.
  void cast(const RayFan& fan,
            std::span<float> total_attenuation,
            ThreadPool* pool = nullptr) const;

  /// The same values, bit for bit, with derivatives, for about a third more time. Derivatives are
  /// those of the line integrals of the interpolant, summed over the same samples: each moves with
  /// the ray, across it. When the entry and exit points of a ray move, samples also slide along it,
  /// which shifts values by the errors of sampling. This is left out, which makes the derivatives
  /// more precise than central differences of values. It is kept at the volume's faces, because a
  /// face may cut a body. \test RayCasterSlopes.ConvergeToThoseOfTheLineIntegral
  void cast_with_slopes(const RayFan& fan,
                        std::span<float> total_attenuation,
                        const MotionSlopes& slopes,
                        ThreadPool* pool = nullptr) const;

  /// Total attenuation of one ray (ct frame).
  [[nodiscard]] float total_attenuation(const Eigen::Vector3d& source_point,
                                        const Eigen::Vector3d& through_point) const;

 private:
  const AttenuationVolume& volume_;
  RayCasterOptions options_;
};

}  // namespace af
