// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/fiducials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/hash_random.h"
#include "evaluate/simulate/automatic_target.h"

namespace af {

namespace {

constexpr double kTetrahedronEdgeMm = 25.0;
constexpr double kLeastDistanceMm = 15.0;
constexpr double kSearchRadiusMm = 10.0;

struct Interval {
  double first = 0.0;
  double last = std::numeric_limits<double>::infinity();

  void intersect(double a, double b) {
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
  void clear() { last = -std::numeric_limits<double>::infinity(); }
};

bool keeps_distance(const Eigen::Vector3d& point, const std::vector<SteelCylinder>& placed) {
  return std::all_of(placed.begin(), placed.end(), [&](const SteelCylinder& other) {
    return (other.center_point - point).norm() >= kLeastDistanceMm;
  });
}

/// The nearest bone voxel within the search radius that keeps its distance, or `wanted` itself.
Eigen::Vector3d nearest_bone(const CtVolume& ct,
                             const Eigen::Vector3d& wanted,
                             const std::vector<SteelCylinder>& placed) {
  const CtGrid& grid = ct.grid;
  const Eigen::Vector3d index = grid.index_of(wanted);
  std::array<int, 3> low{};
  std::array<int, 3> high{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const double reach = kSearchRadiusMm / grid.spacing_mm[axis];
    const double last = grid.size[a] - 1;
    low[a] = static_cast<int>(std::ceil(std::clamp(index[axis] - reach, 0.0, last)));
    high[a] = static_cast<int>(std::floor(std::clamp(index[axis] + reach, 0.0, last)));
  }
  Eigen::Vector3d best = wanted;
  double best_distance = kSearchRadiusMm;
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i) {
        const std::size_t offset =
            (static_cast<std::size_t>(k) * static_cast<std::size_t>(grid.size[1]) +
             static_cast<std::size_t>(j)) *
                static_cast<std::size_t>(grid.size[0]) +
            static_cast<std::size_t>(i);
        if (ct.hu[offset] < kBoneHu) continue;
        const Eigen::Vector3d point = grid.point_mm(Eigen::Vector3d(i, j, k));
        const double distance = (point - wanted).norm();
        if (!(distance < best_distance) || !keeps_distance(point, placed)) continue;
        best = point;
        best_distance = distance;
      }
  return best;
}

}  // namespace

double SteelCylinder::chord_length_mm(const Eigen::Vector3d& source_point,
                                      const Eigen::Vector3d& through_point) const {
  const Eigen::Vector3d direction = (through_point - source_point).normalized();
  const Eigen::Vector3d from_center = source_point - center_point;
  Interval inside;
  // Between the end planes, |(o + t d) . a| <= length / 2.
  const double along = direction.dot(axis_direction);
  const double height = from_center.dot(axis_direction);
  if (along != 0.0)
    inside.intersect((-0.5 * length_mm - height) / along, (0.5 * length_mm - height) / along);
  else if (std::abs(height) > 0.5 * length_mm)
    inside.clear();
  // Within the radius there is a quadratic in t of the parts across the axis.
  const Eigen::Vector3d direction_across = direction - along * axis_direction;
  const Eigen::Vector3d origin_across = from_center - height * axis_direction;
  const double a = direction_across.squaredNorm();
  constexpr double kParallel = 1e-24;  // squared sine of an angle below rounding
  if (a > kParallel) {
    const double closest = -direction_across.dot(origin_across) / a;
    const double miss_squared = (origin_across + closest * direction_across).squaredNorm();
    const double half_squared = (radius_mm * radius_mm - miss_squared) / a;
    if (half_squared > 0.0)
      inside.intersect(closest - std::sqrt(half_squared), closest + std::sqrt(half_squared));
    else
      inside.clear();
  } else if (origin_across.squaredNorm() > radius_mm * radius_mm) {
    inside.clear();
  }
  return std::max(0.0, inside.last - inside.first);
}

std::vector<SteelCylinder> place_fiducials(const CtVolume& ct,
                                           const Eigen::Vector3d& center_ct_mm) {
  const double reach = kTetrahedronEdgeMm / std::sqrt(8.0);  // half the enclosing cube's side
  const std::array<Eigen::Vector3d, 4> corners{Eigen::Vector3d(1, 1, 1),
                                               Eigen::Vector3d(1, -1, -1),
                                               Eigen::Vector3d(-1, 1, -1),
                                               Eigen::Vector3d(-1, -1, 1)};
  std::vector<SteelCylinder> placed;
  for (const Eigen::Vector3d& corner : corners) {
    SteelCylinder pin;
    pin.center_point = nearest_bone(ct, center_ct_mm + reach * corner, placed);
    pin.axis_direction = corner.normalized();  // four different directions, pointing outwards
    placed.push_back(pin);
  }
  return placed;
}

std::vector<Eigen::Vector2d> detect_fiducials(const CameraGeometry& camera,
                                              const RigidTransform& room_from_ct,
                                              std::span<const SteelCylinder> fiducials,
                                              double sigma_px,
                                              std::uint64_t seed,
                                              std::uint64_t key) {
  std::vector<Eigen::Vector2d> detected;
  for (std::size_t i = 0; i < fiducials.size(); ++i) {
    HashRandom random(seed, key, i);
    const double column_error = random.normal();
    const double row_error = random.normal();
    detected.push_back(camera.project(room_from_ct * fiducials[i].center_point) +
                       sigma_px * Eigen::Vector2d(column_error, row_error));
  }
  return detected;
}

}  // namespace af
