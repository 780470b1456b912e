// SPDX-License-Identifier: Apache-2.0
#include "volume/ray_caster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/vector_width.h"
#include "volume/ray_caster_kernel.h"

namespace af {

namespace {

/// The part of a ray (origin + t * direction, voxel indices) inside the volume; empty when end <=
/// begin.
struct Interval {
  double begin;
  double end;
};

Interval clip_to_volume(Interval inside,
                        const Eigen::Vector3d& origin,
                        const Eigen::Vector3d& direction,
                        const Eigen::Vector3d& low,
                        const Eigen::Vector3d& high) {
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0.0) {
      if (!(origin[axis] > low[axis] && origin[axis] < high[axis])) return {0.0, 0.0};
      continue;
    }
    const double a = (low[axis] - origin[axis]) / direction[axis];
    const double b = (high[axis] - origin[axis]) / direction[axis];
    inside.begin = std::max(inside.begin, std::min(a, b));
    inside.end = std::min(inside.end, std::max(a, b));
  }
  return inside;
}

/// Turns a fan given in mm into bundles of rays in voxel indices.
class BundleMaker {
 public:
  BundleMaker(const CtGrid& grid, const RayFan& fan, double step_mm)
      : step_mm_(step_mm), layer_{std::max(0.0, fan.begin), fan.end} {
    const Eigen::Matrix3d index_from_mm =
        grid.spacing_mm.cwiseInverse().asDiagonal() * grid.direction.transpose();
    mm_from_index_ = grid.spacing_mm;
    origin_ = grid.index_of(fan.source_point);
    first_ = index_from_mm * (fan.first_point - fan.source_point);
    column_step_ = index_from_mm * fan.column_step;
    row_step_ = index_from_mm * fan.row_step;
    for (int axis = 0; axis < 3; ++axis) {
      const int last = grid.size[static_cast<std::size_t>(axis)] - 1;
      // Keeps single precision positions inside the border cells, whose outermost part attenuates
      // almost nothing.
      const double margin = std::max(1e-3, 2e-6 * last);
      low_[axis] = margin;
      high_[axis] = last - margin;
    }
  }

  /// Fills lane `lane` with ray (column, row); returns the weight of its samples in mm (0 when it
  /// misses).
  float fill_lane(int column, int row, int lane, RayBundle& bundle) const {
    const Eigen::Vector3d direction = first_ + column * column_step_ + row * row_step_;
    const Interval inside = clip_to_volume(layer_, origin_, direction, low_, high_);
    if (!(inside.end > inside.begin)) {
      clear_lane(lane, bundle);
      return 0.0f;
    }
    const double length_mm =
        (inside.end - inside.begin) * direction.cwiseProduct(mm_from_index_).norm();
    const double samples = std::max(1.0, std::ceil(length_mm / step_mm_));
    const Eigen::Vector3d step = direction * ((inside.end - inside.begin) / samples);
    const Eigen::Vector3d start = origin_ + inside.begin * direction + 0.5 * step;
    for (int axis = 0; axis < 3; ++axis) {
      bundle.start[axis][lane] = static_cast<float>(start[axis]);
      bundle.step[axis][lane] = static_cast<float>(step[axis]);
    }
    bundle.samples[lane] = static_cast<std::int32_t>(samples);
    return static_cast<float>(length_mm / samples);
  }

  static void clear_lane(int lane, RayBundle& bundle) {
    for (int axis = 0; axis < 3; ++axis) {
      bundle.start[axis][lane] = 0.0f;
      bundle.step[axis][lane] = 0.0f;
    }
    bundle.samples[lane] = 0;
  }

 private:
  double step_mm_;
  Interval layer_;
  Eigen::Vector3d mm_from_index_;
  Eigen::Vector3d origin_, first_, column_step_, row_step_;
  Eigen::Vector3d low_, high_;
};

}  // namespace

void RayCasterOptions::describe(Fields& field) {
  field("step_mm", step_mm, "Longest step of ray casting, mm").within(0.01, 100.0);
}

std::vector<std::string> problems(const RayCasterOptions& options) {
  return field_problems(options);
}

RayCaster::RayCaster(const AttenuationVolume& volume, const RayCasterOptions& options)
    : volume_(volume), options_(options) {
  throw_if_any(problems(options));
}

void RayCaster::cast(const RayFan& fan,
                     std::span<float> total_attenuation,
                     ThreadPool* pool) const {
  check(total_attenuation.size() ==
            static_cast<std::size_t>(fan.columns) * static_cast<std::size_t>(fan.rows),
        "one value per ray of the fan");
  const CtGrid& grid = volume_.grid();
  const BundleMaker maker(grid, fan, options_.step_mm);
  const VoxelView voxels{volume_.voxels().data(), grid.size[0], grid.size[0] * grid.size[1]};
  const SumBundle sum_bundle = select_kernel<SumBundle>(
      kernels_128::sum_bundle, kernels_256::sum_bundle, kernels_512::sum_bundle);
  const auto mu_per_mm_per_unit = static_cast<float>(volume_.model().mu_per_mm_per_unit());
  const auto cast_row = [&](int row, int /*slot*/) {
    RayBundle bundle{};
    std::array<float, RayBundle::kRays> weights_mm{};
    std::array<float, RayBundle::kRays> sums{};
    auto next = static_cast<std::size_t>(row) * static_cast<std::size_t>(fan.columns);
    for (int first = 0; first < fan.columns; first += RayBundle::kRays) {
      const int count = std::min(RayBundle::kRays, fan.columns - first);
      for (int lane = 0; lane < RayBundle::kRays; ++lane) {
        const auto i = static_cast<std::size_t>(lane);
        weights_mm[i] = 0.0f;
        if (lane < count)
          weights_mm[i] = maker.fill_lane(first + lane, row, lane, bundle);
        else
          BundleMaker::clear_lane(lane, bundle);
      }
      sum_bundle(voxels, bundle, sums.data());
      for (int lane = 0; lane < count; ++lane) {
        const auto i = static_cast<std::size_t>(lane);
        total_attenuation[next++] = sums[i] * (weights_mm[i] * mu_per_mm_per_unit);
      }
    }
  };
  if (pool != nullptr)
    pool->for_each(fan.rows, cast_row);
  else
    for (int row = 0; row < fan.rows; ++row) cast_row(row, 0);
}

float RayCaster::total_attenuation(const Eigen::Vector3d& source_point,
                                   const Eigen::Vector3d& through_point) const {
  std::array<float, 1> value{};
  cast({source_point, through_point, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 1, 1},
       value);
  return value[0];
}

}  // namespace af
