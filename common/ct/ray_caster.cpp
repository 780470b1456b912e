// SPDX-License-Identifier: Apache-2.0
#include "ct/ray_caster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/stop_condition.h"
#include "base/vector_width.h"
#include "ct/ray_caster_kernel.h"
#include "ct/ray_slopes.h"

namespace af {

namespace {

/// The part of a ray (origin + t * direction, voxel indices) inside the volume. Empty when end <=
/// begin.
struct Interval {
  double begin;
  double end;
  int begin_axis = RayPath::kNoFace;  ///< axis of the face that cuts it off there
  int end_axis = RayPath::kNoFace;
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
    if (std::min(a, b) > inside.begin) {
      inside.begin = std::min(a, b);
      inside.begin_axis = axis;
    }
    if (std::max(a, b) < inside.end) {
      inside.end = std::max(a, b);
      inside.end_axis = axis;
    }
  }
  return inside;
}

using LaneValues = std::array<float, RayBundle::kRays>;

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
      // The margin keeps single-precision positions inside the border cells, whose outermost part
      // attenuates almost nothing.
      const double margin = std::max(1e-3, 2e-6 * last);
      low_[axis] = margin;
      high_[axis] = last - margin;
    }
  }

  /// The sums of one lane, as the mechanics need them.
  [[nodiscard]] RaySums ray_sums(float weight_mm,
                                 float mu_per_mm_per_unit,
                                 const SlopeSums& sums,
                                 std::size_t lane) const {
    const auto mu_per_mm = static_cast<double>(mu_per_mm_per_unit);
    const double scale = static_cast<double>(weight_mm) * mu_per_mm;
    const auto in_mm = [&](const float(&per_voxel)[3][RayBundle::kRays]) {
      const Eigen::Vector3d slopes(per_voxel[0][lane], per_voxel[1][lane], per_voxel[2][lane]);
      return Eigen::Vector3d(scale * slopes.cwiseQuotient(mm_from_index_));
    };
    return {in_mm(sums.slopes),
            in_mm(sums.numbered_slopes),
            mu_per_mm * static_cast<double>(sums.stretched_begin[lane]),
            mu_per_mm * static_cast<double>(sums.stretched_end[lane])};
  }

  /// The path of ray (column, row).
  [[nodiscard]] RayPath path(int column, int row) const {
    const Eigen::Vector3d direction = direction_of(column, row);
    const Interval inside = inside_of(direction);
    if (!(inside.end > inside.begin)) return {};
    return {mm_from_index_.cwiseProduct(origin_ + inside.begin * direction),
            mm_from_index_.cwiseProduct(origin_ + inside.end * direction),
            inside.begin_axis,
            inside.end_axis,
            static_cast<int>(samples_of(length_mm(inside, direction)))};
  }

  /// Fills a bundle with `count` rays of a row from `column` on, and writes the weights of their
  /// samples.
  void fill(int column, int row, int count, RayBundle& bundle, LaneValues& weights_mm) const {
    for (int lane = 0; lane < RayBundle::kRays; ++lane) {
      const auto i = static_cast<std::size_t>(lane);
      weights_mm[i] = 0.0f;
      if (lane < count)
        weights_mm[i] = fill_lane(column + lane, row, lane, bundle);
      else
        clear_lane(lane, bundle);
    }
  }

 private:
  /// Fills lane `lane` with ray (column, row). Returns the weight of its samples in mm, 0 when it
  /// misses.
  float fill_lane(int column, int row, int lane, RayBundle& bundle) const {
    const Eigen::Vector3d direction = direction_of(column, row);
    const Interval inside = inside_of(direction);
    if (!(inside.end > inside.begin)) {
      clear_lane(lane, bundle);
      return 0.0f;
    }
    const double length = length_mm(inside, direction);
    const double samples = samples_of(length);
    const Eigen::Vector3d step = direction * ((inside.end - inside.begin) / samples);
    const Eigen::Vector3d start = origin_ + inside.begin * direction + 0.5 * step;
    for (int axis = 0; axis < 3; ++axis) {
      bundle.start[axis][lane] = static_cast<float>(start[axis]);
      bundle.step[axis][lane] = static_cast<float>(step[axis]);
    }
    bundle.samples[lane] = static_cast<std::int32_t>(samples);
    return static_cast<float>(length / samples);
  }

  static void clear_lane(int lane, RayBundle& bundle) {
    for (int axis = 0; axis < 3; ++axis) {
      bundle.start[axis][lane] = 0.0f;
      bundle.step[axis][lane] = 0.0f;
    }
    bundle.samples[lane] = 0;
  }

  [[nodiscard]] Eigen::Vector3d direction_of(int column, int row) const {
    return first_ + column * column_step_ + row * row_step_;
  }
  /// Also empty where its ends turn out to lie outside the volume or its length is not a number:
  /// the source is so far away that rounding loses them, or the ray has no direction.
  [[nodiscard]] Interval inside_of(const Eigen::Vector3d& direction) const {
    const Interval inside = clip_to_volume(layer_, origin_, direction, low_, high_);
    for (const double at : {inside.begin, inside.end}) {
      const Eigen::Array3d point = origin_ + at * direction;
      if (!(point >= 0.0).all() || !(point <= high_.array() + low_.array()).all())
        return {0.0, 0.0};
    }
    if (!std::isfinite(length_mm(inside, direction))) return {0.0, 0.0};
    return inside;
  }
  [[nodiscard]] double length_mm(const Interval& inside, const Eigen::Vector3d& direction) const {
    return (inside.end - inside.begin) * direction.cwiseProduct(mm_from_index_).norm();
  }
  [[nodiscard]] double samples_of(double length_mm) const {
    return std::max(1.0, std::ceil(length_mm / step_mm_));
  }

  double step_mm_;
  Interval layer_;
  Eigen::Vector3d mm_from_index_;
  Eigen::Vector3d origin_, first_, column_step_, row_step_;
  Eigen::Vector3d low_, high_;
};

/// Casts the rows of a fan.
class FanCaster {
 public:
  FanCaster(const AttenuationVolume& volume, const RayFan& fan, double step_mm)
      : maker_(volume.grid(), fan, step_mm),
        columns_(fan.columns),
        voxels_{volume.voxels().data(),
                volume.grid().size[0],
                volume.grid().size[0] * volume.grid().size[1]},
        mu_per_mm_per_unit_(static_cast<float>(volume.model().mu_per_mm_per_unit())) {}

  void cast_row(int row, std::span<float> values) const {
    LaneValues sums{};
    for_each_bundle(row,
                    [&](const RayBundle& bundle, const Run& run, const LaneValues& weights_mm) {
                      sum_bundle_(voxels_, bundle, sums.data());
                      for (std::size_t i = 0; i < run.count; ++i)
                        values[run.offset + i] = sums[i] * (weights_mm[i] * mu_per_mm_per_unit_);
                    });
  }

  /// `planes`: six planes of the same size.
  void cast_row(int row,
                const RayMechanics& mechanics,
                std::span<float> values,
                std::span<float> planes) const {
    SlopeSums sums{};
    for_each_bundle(
        row, [&](const RayBundle& bundle, const Run& run, const LaneValues& weights_mm) {
          sum_bundle_with_slopes_(voxels_, bundle, sums);
          for (std::size_t i = 0; i < run.count; ++i) {
            values[run.offset + i] = sums.values[i] * (weights_mm[i] * mu_per_mm_per_unit_);
            const RayPath path = maker_.path(run.column + static_cast<int>(i), row);
            const auto slopes = mechanics.slopes_of(
                path, maker_.ray_sums(weights_mm[i], mu_per_mm_per_unit_, sums, i));
            for (std::size_t k = 0; k < slopes.size(); ++k)
              planes[k * values.size() + run.offset + i] = slopes[k];
          }
        });
  }

 private:
  /// Neighbouring rays of a row.
  struct Run {
    int column;
    std::size_t offset;  ///< of the first one's value
    std::size_t count;
  };

  /// Calls work(bundle, run, weights_mm) for the rays of a row.
  template <typename Work>
  void for_each_bundle(int row, const Work& work) const {
    RayBundle bundle{};
    LaneValues weights_mm{};
    const auto first = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
    for (int column = 0; column < columns_; column += RayBundle::kRays) {
      const int count = std::min(RayBundle::kRays, columns_ - column);
      maker_.fill(column, row, count, bundle, weights_mm);
      const auto offset = first + static_cast<std::size_t>(column);
      work(bundle, Run{column, offset, static_cast<std::size_t>(count)}, weights_mm);
    }
  }

  BundleMaker maker_;
  int columns_;
  VoxelView voxels_;
  float mu_per_mm_per_unit_;
  SumBundle sum_bundle_ = select_kernel<SumBundle>(
      kernels_128::sum_bundle, kernels_256::sum_bundle, kernels_512::sum_bundle);
  SumBundleWithSlopes sum_bundle_with_slopes_ =
      select_kernel<SumBundleWithSlopes>(kernels_128::sum_bundle_with_slopes,
                                         kernels_256::sum_bundle_with_slopes,
                                         kernels_512::sum_bundle_with_slopes);
};

/// Calls work(row) for the rows of a fan. The threads of a pool share them, when there is one.
template <typename Work>
void for_each_row(const RayFan& fan, ThreadPool* pool, const Work& work) {
  if (pool != nullptr) {
    pool->for_each(fan.rows, [&](int row, int /*slot*/) { work(row); });
    return;
  }
  for (int row = 0; row < fan.rows; ++row) {
    throw_if_stopped();
    work(row);
  }
}

void require_value_per_ray(const RayFan& fan, std::span<const float> values) {
  check(values.size() == static_cast<std::size_t>(fan.columns) * static_cast<std::size_t>(fan.rows),
        "one value per ray of the fan");
}

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
  require_value_per_ray(fan, total_attenuation);
  const FanCaster caster(volume_, fan, options_.step_mm);
  for_each_row(fan, pool, [&](int row) { caster.cast_row(row, total_attenuation); });
}

void RayCaster::cast_with_slopes(const RayFan& fan,
                                 std::span<float> total_attenuation,
                                 const MotionSlopes& slopes,
                                 ThreadPool* pool) const {
  require_value_per_ray(fan, total_attenuation);
  check(slopes.planes.size() == 6 * total_attenuation.size(), "six planes of one value per ray");
  const FanCaster caster(volume_, fan, options_.step_mm);
  const RayMechanics mechanics(volume_.grid(), slopes);
  for_each_row(fan, pool, [&](int row) {
    caster.cast_row(row, mechanics, total_attenuation, slopes.planes);
  });
}

float RayCaster::total_attenuation(const Eigen::Vector3d& source_point,
                                   const Eigen::Vector3d& through_point) const {
  std::array<float, 1> value{};
  cast({source_point, through_point, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 1, 1},
       value);
  return value[0];
}

}  // namespace af
