// SPDX-License-Identifier: Apache-2.0
#include "support/ct_phantoms.h"

#include <cmath>

#include "base/error.h"

namespace af {

namespace {

constexpr std::int16_t kAirHu = -1000;

/// Maps ct points to the frame in which the body is the unit sphere.
Eigen::Vector3d to_unit_sphere(const Ellipsoid& body, const Eigen::Vector3d& vector_mm) {
  return (body.rotation.transpose() * vector_mm).cwiseQuotient(body.semi_axes_mm);
}

int hu_at(const std::vector<Ellipsoid>& bodies, const Eigen::Vector3d& point_mm) {
  for (auto body = bodies.rbegin(); body != bodies.rend(); ++body)
    if (to_unit_sphere(*body, point_mm - body->center_mm).squaredNorm() <= 1.0) return body->hu;
  return kAirHu;
}

}  // namespace

double Ellipsoid::chord_length_mm(const Eigen::Vector3d& point,
                                  const Eigen::Vector3d& through_point) const {
  const Eigen::Vector3d origin = to_unit_sphere(*this, point - center_mm);
  const Eigen::Vector3d direction = to_unit_sphere(*this, through_point - point);
  const double along = origin.dot(direction) / direction.squaredNorm();
  const double distance_squared = (origin - along * direction).squaredNorm();
  if (!(distance_squared < 1.0)) return 0.0;
  const double half_chord = std::sqrt((1.0 - distance_squared) / direction.squaredNorm());
  return 2.0 * half_chord * (through_point - point).norm();
}

CtVolume box_phantom(const CtGrid& grid,
                     const std::array<int, 3>& first_voxel,
                     const std::array<int, 3>& last_voxel,
                     int hu) {
  std::vector<std::int16_t> voxels(grid.voxel_count(), kAirHu);
  std::size_t next = 0;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i, ++next)
        if (i >= first_voxel[0] && i <= last_voxel[0] && j >= first_voxel[1] &&
            j <= last_voxel[1] && k >= first_voxel[2] && k <= last_voxel[2])
          voxels[next] = static_cast<std::int16_t>(hu);
  return {grid, SharedArray<std::int16_t>(std::move(voxels))};
}

CtVolume ellipsoid_phantom(const CtGrid& grid,
                           const std::vector<Ellipsoid>& bodies,
                           int samples_per_axis) {
  check(samples_per_axis > 0, "at least one sample per axis");
  const double samples_per_voxel = std::pow(samples_per_axis, 3);
  const auto offset = [&](int sample) { return (sample + 0.5) / samples_per_axis - 0.5; };
  std::vector<std::int16_t> voxels(grid.voxel_count());
  std::size_t next = 0;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i, ++next) {
        double sum = 0.0;
        for (int c = 0; c < samples_per_axis; ++c)
          for (int b = 0; b < samples_per_axis; ++b)
            for (int a = 0; a < samples_per_axis; ++a)
              sum += hu_at(bodies, grid.point_mm({i + offset(a), j + offset(b), k + offset(c)}));
        voxels[next] = static_cast<std::int16_t>(std::lround(sum / samples_per_voxel));
      }
  return {grid, SharedArray<std::int16_t>(std::move(voxels))};
}

}  // namespace af
