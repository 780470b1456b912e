// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include <Eigen/Core>

namespace af {

/// Line integrals of relative attenuation (1 for water) along a ray, as mm of water that attenuate
/// alike at the effective energy.
struct PathIntegrals {
  double water_mm = 0.0;
  double bone_mm = 0.0;
};

/// What X-rays are made from: anatomy as voxels or as bodies. Re-entrant.
class RayIntegrator {
 public:
  RayIntegrator() = default;
  RayIntegrator(const RayIntegrator&) = delete;
  RayIntegrator& operator=(const RayIntegrator&) = delete;
  virtual ~RayIntegrator() = default;

  /// Integrals over the half-line from `source_point` through `through_point` and beyond (ct, mm).
  /// A source inside the volume starts there.
  [[nodiscard]] virtual PathIntegrals integrate(const Eigen::Vector3d& source_point,
                                                const Eigen::Vector3d& through_point) const = 0;

  /// Integrals of neighbouring rays, one per sum, with exactly the bits of integrate().
  virtual void integrate_row(const Eigen::Vector3d& source_point,
                             std::span<const Eigen::Vector3d> through_points,
                             std::span<PathIntegrals> sums) const {
    for (std::size_t i = 0; i < through_points.size(); ++i)
      sums[i] = integrate(source_point, through_points[i]);
  }
};

}  // namespace af
