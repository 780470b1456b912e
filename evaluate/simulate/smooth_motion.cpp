// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/smooth_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/hash_random.h"
#include "evaluate/simulate/parallel_rows.h"

namespace af {

namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

/// Trilinear HU at continuous voxel indices, edges replicated.
double hu_at(const CtVolume& ct, const Eigen::Vector3d& index) {
  std::array<std::size_t, 3> low{};
  std::array<std::size_t, 3> high{};
  std::array<double, 3> part{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int last = ct.grid.size[axis] - 1;
    const double position =
        std::clamp(index[static_cast<Eigen::Index>(axis)], 0.0, static_cast<double>(last));
    const int floor = static_cast<int>(position);
    low[axis] = static_cast<std::size_t>(floor);
    high[axis] = static_cast<std::size_t>(std::min(floor + 1, last));
    part[axis] = position - floor;
  }
  const auto columns = static_cast<std::size_t>(ct.grid.size[0]);
  const auto rows = static_cast<std::size_t>(ct.grid.size[1]);
  const auto along_i = [&](std::size_t j, std::size_t k) {
    const std::size_t row = (k * rows + j) * columns;
    return std::lerp(static_cast<double>(ct.hu[row + low[0]]),
                     static_cast<double>(ct.hu[row + high[0]]),
                     part[0]);
  };
  const auto along_j = [&](std::size_t k) {
    return std::lerp(along_i(low[1], k), along_i(high[1], k), part[1]);
  };
  return std::lerp(along_j(low[2]), along_j(high[2]), part[2]);
}

}  // namespace

SmoothMotion::SmoothMotion(const CtBox& still_box_ct,
                           const SmoothMotionOptions& options,
                           std::uint64_t seed,
                           std::uint64_t key)
    : still_box_ct_(still_box_ct), options_(options) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    HashRandom random(seed, key, axis);
    const double x = random.normal();
    const double y = random.normal();
    const double z = random.normal();
    wave_vectors_per_mm_[axis] =
        kTwoPi / options.wavelength_mm * Eigen::Vector3d(x, y, z).normalized();
    phases_rad_[static_cast<Eigen::Index>(axis)] = random.uniform(0.0, kTwoPi);
  }
}

double SmoothMotion::ramp(const Eigen::Vector3d& ct_point_mm) const {
  const Eigen::Vector3d outside = (still_box_ct_.low_mm - ct_point_mm)
                                      .cwiseMax(ct_point_mm - still_box_ct_.high_mm)
                                      .cwiseMax(0.0);
  const double t = std::clamp((outside.norm() - options_.margin_mm) / options_.ramp_mm, 0.0, 1.0);
  return t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
}

Eigen::Vector3d SmoothMotion::displacement_mm(const Eigen::Vector3d& ct_point_mm) const {
  const double share = ramp(ct_point_mm);
  if (share == 0.0) return Eigen::Vector3d::Zero();
  Eigen::Vector3d displacement;
  for (Eigen::Index axis = 0; axis < 3; ++axis)
    displacement[axis] = std::sin(
        wave_vectors_per_mm_[static_cast<std::size_t>(axis)].dot(ct_point_mm) + phases_rad_[axis]);
  return options_.amplitude_mm * share * displacement;
}

void SmoothMotion::displace(std::span<Eigen::Vector3d> line_ct_mm) const {
  const Eigen::Vector3d step_mm =
      (line_ct_mm.back() - line_ct_mm.front()) / static_cast<double>(line_ct_mm.size() - 1);
  // The waves' phases turn by the same angles from point to point.
  Eigen::Array3d phases = phases_rad_.array();
  Eigen::Array3d turns;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    phases[i] += wave_vectors_per_mm_[axis].dot(line_ct_mm.front());
    turns[i] = wave_vectors_per_mm_[axis].dot(step_mm);
  }
  Eigen::Array3d sines = phases.sin();
  Eigen::Array3d cosines = phases.cos();
  const Eigen::Array3d turn_sines = turns.sin();
  const Eigen::Array3d turn_cosines = turns.cos();
  for (Eigen::Vector3d& point : line_ct_mm) {
    point += options_.amplitude_mm * ramp(point) * sines.matrix();
    const Eigen::Array3d before = sines;
    sines = before * turn_cosines + cosines * turn_sines;
    cosines = cosines * turn_cosines - before * turn_sines;
  }
}

double SmoothMotion::largest_mm() const {
  return std::sqrt(3.0) * options_.amplitude_mm;
}

CtVolume SmoothMotion::moved(const CtVolume& ct) const {
  const CtGrid& grid = ct.grid;
  std::vector<std::int16_t> voxels(grid.voxel_count());
  for_each_row(grid.size[2], options_.threads, [&](int k) {
    std::size_t voxel = static_cast<std::size_t>(k) * static_cast<std::size_t>(grid.size[0]) *
                        static_cast<std::size_t>(grid.size[1]);
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i, ++voxel) {
        const Eigen::Vector3d point = grid.point_mm(Eigen::Vector3d(i, j, k));
        const Eigen::Vector3d displacement = displacement_mm(point);
        voxels[voxel] = displacement.isZero(0.0) ? ct.hu[voxel]
                                                 : static_cast<std::int16_t>(std::lround(hu_at(
                                                       ct, grid.index_of(point + displacement))));
      }
  });
  return {grid, SharedArray<std::int16_t>(std::move(voxels))};
}

}  // namespace af
