// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/least_squares_caster.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "base/error.h"
#include "support/cast_plan.h"

namespace af {
namespace {

/// A sample as a function of the viewpoint (mm) and the (s,t) node.
using SampleAt = std::function<int(double u_mm, double v_mm, int s, int t)>;

class FunctionCaster final : public FieldCaster {
 public:
  FunctionCaster(const LightSlab& planes, SampleAt sample_at)
      : planes_(planes), sample_at_(std::move(sample_at)) {}

  void cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const override {
    auto sample = samples.begin();
    for (int u = unit.u.begin; u < unit.u.end(); ++u)
      for (int v = unit.v.begin; v < unit.v.end(); ++v)
        for (int s = unit.s.begin; s < unit.s.end(); ++s)
          for (int t = unit.t.begin; t < unit.t.end(); ++t)
            *sample++ = static_cast<std::uint16_t>(
                sample_at_(planes_.u.position_mm(u), planes_.v.position_mm(v), s, t));
  }

 private:
  const LightSlab& planes_;
  SampleAt sample_at_;
};

/// Viewpoints 10 mm apart along u, 20 mm along v; a part of the (s,t) nodes is stored.
LightSlab planes_of(int u_nodes, int v_nodes) {
  LightSlab planes;
  planes.uv_plane_y_mm = 500.0;
  planes.u = {-20.0, -20.0 + 10.0 * (u_nodes - 1), u_nodes};
  planes.v = {-40.0, -40.0 + 20.0 * (v_nodes - 1), v_nodes};
  SlabGeometry slab;
  slab.s = {-60.0, 60.0, 9};
  slab.t = {-50.0, 55.0, 8};
  slab.stored_s = {2, 5};
  slab.stored_t = {0, 3};
  planes.slabs.push_back(slab);
  return planes;
}

LeastSquaresFieldCaster fitting(const LightSlab& planes, const SampleAt& sample_at) {
  return {planes, [&](const LightSlab& cast_planes) {
            return std::make_unique<const FunctionCaster>(cast_planes, sample_at);
          }};
}

/// Anything between 0 and 65535 for any ray.
int noise_at(double u_mm, double v_mm, int s, int t) {
  const double mixed = std::sin(12.9898 * u_mm + 78.233 * v_mm + 37.719 * s + 11.131 * t) * 43758.5;
  return static_cast<int>(65535.0 * (mixed - std::floor(mixed)));
}

/// Value at x = 0 of the line that comes nearest to f(0), f(1/2), f(1), with Simpson's weights.
/// Solves the normal equations independently of the caster.
double start_of_line(double first, double halfway, double last) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  const double weights[] = {1.0, 4.0, 1.0};
  const double values[] = {first, halfway, last};
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector2d line(1.0, 0.5 * i);
    normal += weights[i] * line * line.transpose();
    right += weights[i] * values[i] * line;
  }
  return normal.ldlt().solve(right)[0];
}

/// The mean of the lines on both sides of a place on an axis, less the value there.
double change_along(const GridAxis& axis, int node, const std::function<double(double)>& value_at) {
  const double at = axis.position_mm(node);
  double sum = 0.0;
  int cells = 0;
  for (const int side : {-1, 1}) {
    if (node + side < 0 || node + side >= axis.nodes) continue;
    const double step = side * axis.spacing_mm();
    sum += start_of_line(value_at(at), value_at(at + 0.5 * step), value_at(at + step));
    ++cells;
  }
  return sum / cells - value_at(at);
}

TEST(LeastSquaresCaster, SamplesAreTheMeansOfTheLinesBesideThem) {
  const LightSlab planes = planes_of(5, 4);
  int clamped_low = 0;
  int clamped_high = 0;
  for (const auto& [node, sample] : cast_plan(fitting(planes, noise_at), planes)) {
    const auto [u, v, s, t] = node;
    const double u_mm = planes.u.position_mm(u);
    const double v_mm = planes.v.position_mm(v);
    const double exact =
        noise_at(u_mm, v_mm, s, t) +
        change_along(planes.u, u, [&, s = s, t = t](double x) { return noise_at(x, v_mm, s, t); }) +
        change_along(planes.v, v, [&, s = s, t = t](double x) { return noise_at(u_mm, x, s, t); });
    EXPECT_NEAR(sample, std::clamp(exact, 0.0, 65535.0), 0.5 + 1e-6);
    clamped_low += exact < 0.0 ? 1 : 0;
    clamped_high += exact > 65535.0 ? 1 : 0;
  }
  EXPECT_GT(clamped_low, 10);
  EXPECT_GT(clamped_high, 3);
}

TEST(LeastSquaresCaster, LinearFunctionsStayAsTheyAre) {
  const LightSlab planes = planes_of(6, 3);
  const SampleAt linear = [](double u_mm, double v_mm, int s, int t) {
    return static_cast<int>(std::lround(3000.0 + 6.0 * u_mm - 9.0 * v_mm + 100.0 * s + t));
  };
  for (const auto& [node, sample] : cast_plan(fitting(planes, linear), planes))
    EXPECT_EQ(
        sample,
        linear(planes.u.position_mm(node[0]), planes.v.position_mm(node[1]), node[2], node[3]));
}

TEST(LeastSquaresCaster, InterpolationOfAQuadraticErrsToBothSidesEqually) {
  const LightSlab planes = planes_of(5, 4);
  constexpr double kPerSquareMm = 1.2;
  const SampleAt quadratic = [](double u_mm, double v_mm, int, int) {
    return static_cast<int>(std::lround(9000.0 + kPerSquareMm * (u_mm * u_mm + v_mm * v_mm)));
  };
  // Interpolation between exact values would exceed the function by x (1 - x) h^2 times this
  // factor; its mean over a cell is a sixth of that at x (1 - x) = 1.
  const double shift = kPerSquareMm * (10.0 * 10.0 + 20.0 * 20.0) / 6.0;
  // Each line integral is rounded, and their weights sum to 14 / 6; the result is rounded again.
  constexpr double kRounding = 0.5 * 14.0 / 6.0 + 0.5;
  for (const auto& [node, sample] : cast_plan(fitting(planes, quadratic), planes)) {
    const double u_mm = planes.u.position_mm(node[0]);
    const double v_mm = planes.v.position_mm(node[1]);
    EXPECT_NEAR(sample, 9000.0 + kPerSquareMm * (u_mm * u_mm + v_mm * v_mm) - shift, kRounding);
  }
}

TEST(LeastSquaresCaster, SamplesDoNotDependOnThePlan) {
  const LightSlab planes = planes_of(7, 5);
  const LeastSquaresFieldCaster caster = fitting(planes, noise_at);
  const NodeSamples expected = cast_plan(caster, planes);
  EXPECT_EQ(expected.size(), 7u * 5u * 5u * 3u);
  for (const std::int64_t rays_per_unit : {1, 60, 300})
    EXPECT_EQ(cast_plan(caster, planes, {rays_per_unit}), expected);
}

TEST(LeastSquaresCaster, NeedsThreeViewpointsAlongEachAxis) {
  const LightSlab planes = planes_of(2, 5);
  EXPECT_THROW(fitting(planes, noise_at), InputError);
}

TEST(LeastSquaresCaster, HoldsALittleMoreThanThreeTimesALargeUnit) {
  WorkUnit unit;
  unit.u = {0, 12};
  unit.v = {0, 12};
  unit.s = {0, 10};
  unit.t = {0, 10};
  EXPECT_EQ(LeastSquaresFieldCaster::held_samples(unit), 100u * (14 * 14 + 2 * 13 * 12));
}

}  // namespace
}  // namespace af
