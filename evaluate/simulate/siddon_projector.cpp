// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/siddon_projector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "base/error.h"

namespace af {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A ray in voxel units. Voxel i fills [i, i + 1) on its axis; t is in mm along the ray.
struct VoxelRay {
  std::array<double, 3> origin;
  std::array<double, 3> direction;  ///< voxels per mm
};

struct Interval {
  double first;
  double last;
};

VoxelRay voxel_ray(const CtGrid& grid,
                   const Eigen::Vector3d& source_point,
                   const Eigen::Vector3d& through_point) {
  const Eigen::Vector3d origin = grid.index_of(source_point) + Eigen::Vector3d::Constant(0.5);
  const Eigen::Vector3d unit = (through_point - source_point).normalized();
  const Eigen::Vector3d direction =
      (grid.direction.transpose() * unit).cwiseQuotient(grid.spacing_mm);
  return {{origin.x(), origin.y(), origin.z()}, {direction.x(), direction.y(), direction.z()}};
}

/// The part of the half-line t >= 0 inside the volume.
std::optional<Interval> clip(const VoxelRay& ray, const std::array<int, 3>& size) {
  Interval inside{0.0, kInfinity};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (ray.direction[axis] == 0.0) {
      if (!(ray.origin[axis] >= 0.0 && ray.origin[axis] < size[axis])) return std::nullopt;
      continue;
    }
    const double at_low = -ray.origin[axis] / ray.direction[axis];
    const double at_high = (size[axis] - ray.origin[axis]) / ray.direction[axis];
    inside.first = std::max(inside.first, std::min(at_low, at_high));
    inside.last = std::min(inside.last, std::max(at_low, at_high));
  }
  if (!(inside.first < inside.last)) return std::nullopt;
  return inside;
}

/// Position in the walk from voxel to voxel.
struct Walk {
  std::array<int, 3> voxel;
  std::array<int, 3> step;         ///< -1, 0, 1
  std::array<double, 3> next_mm;   ///< t of the next face on each axis
  std::array<double, 3> pitch_mm;  ///< t between faces
};

Walk start_of_walk(const VoxelRay& ray, const std::array<int, 3>& size, double first_mm) {
  Walk walk{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double direction = ray.direction[axis];
    const double position = ray.origin[axis] + first_mm * direction;
    int voxel = static_cast<int>(std::floor(position));
    // A ray that falls from a face enters the voxel below it.
    if (direction < 0.0 && position == static_cast<double>(voxel)) --voxel;
    voxel = std::clamp(voxel, 0, size[axis] - 1);
    walk.voxel[axis] = voxel;
    walk.step[axis] = direction > 0.0 ? 1 : (direction < 0.0 ? -1 : 0);
    walk.pitch_mm[axis] = direction == 0.0 ? kInfinity : 1.0 / std::abs(direction);
    walk.next_mm[axis] = direction == 0.0
                             ? kInfinity
                             : (voxel + (direction > 0.0 ? 1 : 0) - ray.origin[axis]) / direction;
  }
  return walk;
}

}  // namespace

SiddonProjector::SiddonProjector(const AttenuationVolume& volume, const TissueModel& tissue)
    : volume_(volume), tissue_(tissue) {
  check(volume.model().mu_water_per_mm == tissue.attenuation_model().mu_water_per_mm,
        "volume and tissue model must share one HU scale");
}

PathIntegrals SiddonProjector::integrate(const Eigen::Vector3d& source_point,
                                         const Eigen::Vector3d& through_point) const {
  const auto& size = volume_.grid().size;
  const VoxelRay ray = voxel_ray(volume_.grid(), source_point, through_point);
  const std::optional<Interval> inside = clip(ray, size);
  if (!inside) return {};

  Walk walk = start_of_walk(ray, size, inside->first);
  const std::array<std::ptrdiff_t, 3> stride{
      1, size[0], static_cast<std::ptrdiff_t>(size[0]) * size[1]};
  std::ptrdiff_t offset = walk.voxel[0] + walk.voxel[1] * stride[1] + walk.voxel[2] * stride[2];
  const std::uint16_t* voxels = volume_.voxels().data();
  double t_mm = inside->first;
  double all = 0.0;
  double bone = 0.0;
  while (true) {
    const auto axis = static_cast<std::size_t>(walk.next_mm[0] < walk.next_mm[1]
                                                   ? (walk.next_mm[0] < walk.next_mm[2] ? 0 : 2)
                                                   : (walk.next_mm[1] < walk.next_mm[2] ? 1 : 2));
    const double end_mm = std::min(walk.next_mm[axis], inside->last);
    const std::uint16_t relative = voxels[offset];
    if (relative != 0 && end_mm > t_mm) {
      all += relative * (end_mm - t_mm);
      bone += static_cast<double>(tissue_.bone_part(relative)) * (end_mm - t_mm);
    }
    t_mm = std::max(t_mm, end_mm);
    if (!(t_mm < inside->last)) break;
    walk.voxel[axis] += walk.step[axis];
    if (walk.voxel[axis] < 0 || walk.voxel[axis] >= size[axis]) break;
    offset += walk.step[axis] * stride[axis];
    walk.next_mm[axis] += walk.pitch_mm[axis];
  }
  return {(all - bone) / 1000.0, bone / 1000.0};
}

}  // namespace af
