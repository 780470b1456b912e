// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_sum.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

namespace af {
namespace {

constexpr int kPadding = 64;

/// The image of a function of the place on a plane, with its memory.
struct Picture {
  NodeGrid grid;
  std::vector<float> values;

  Picture(const NodeGrid& nodes, const std::function<double(double, double)>& function)
      : grid(nodes),
        values(static_cast<std::size_t>(nodes.stride * (nodes.t_count + 4) + kPadding)) {
    for (int t = 0; t < grid.t_count; ++t)
      for (int s = 0; s < grid.s_count; ++s)
        values[static_cast<std::size_t>(t * grid.stride + s)] = static_cast<float>(function(
            grid.s_first_mm + s * grid.s_spacing_mm, grid.t_first_mm + t * grid.t_spacing_mm));
  }
  explicit Picture(const NodeGrid& nodes)
      : Picture(nodes, [](double, double) { return std::nan(""); }) {}
};

NodeGrid grid_at(double plane_y_mm, double scale) {
  return {-20.0 * scale, 0.5 * scale, -14.0 * scale, 0.4 * scale, plane_y_mm, 96, 81, 71};
}

const Eigen::Vector3d kSource{3.0, 600.0, -2.0};

/// A cubic of the place on a plane, which four taps reproduce.
double cubic(double x, double z) {
  return 2.0 + 0.05 * x - 0.03 * z + 0.002 * x * x + 1e-4 * x * x * x - 2e-4 * x * z * z;
}

TEST(SlabSum, OfOneSlabInItsOwnPlaneIsTheSlab) {
  const Picture slab(grid_at(10.0, 1.0), cubic);
  Picture sum(slab.grid);
  SlabSumScratch scratch;
  SlabSum(slab.grid, kSource, {sum.values.data(), nullptr, nullptr}, scratch)
      .add({slab.grid, {slab.values.data(), nullptr, nullptr}});
  for (int t = 0; t < slab.grid.t_count; ++t)
    for (int s = 0; s < slab.grid.s_count; ++s) {
      const auto at = static_cast<std::size_t>(t * slab.grid.stride + s);
      ASSERT_NEAR(sum.values[at], slab.values[at], 1e-6) << s << ' ' << t;
    }
}

/// What two slabs show along the ray through each node of a plane between them. Differences of it
/// say how it changes as the source moves while the node stays.
TEST(SlabSum, ShowsWhatTheSlabsShowAndHowItMovesWithTheSource) {
  const std::array<double, 2> planes{-30.0, 45.0};
  const NodeGrid sum_grid{-15.0, 0.5, -10.0, 0.4, 5.0, 64, 61, 51};
  const auto far_cubic = [](double x, double z) { return 1.0 + cubic(z, x); };
  // The slabs' own slopes with the source, per mm; any functions do.
  const auto slope_x = [](double x, double z) { return 0.02 * x - 0.01 * z; };
  const auto slope_z = [](double x, double z) { return 0.03 + 0.01 * x * z; };
  const auto shown = [&](const Eigen::Vector3d& source, double x, double z) {
    double value = 0.0;
    for (const double plane : planes) {
      const double ratio = (plane - source.y()) / (sum_grid.plane_y_mm - source.y());
      const double at_x = source.x() + ratio * (x - source.x());
      const double at_z = source.z() + ratio * (z - source.z());
      value += plane < 0.0 ? cubic(at_x, at_z) : far_cubic(at_x, at_z);
      value += (source.x() - kSource.x()) * slope_x(at_x, at_z) +
               (source.z() - kSource.z()) * slope_z(at_x, at_z);
    }
    return value;
  };
  const auto step = [&](const Eigen::Vector3d& direction, double x, double z) {
    constexpr double kStep = 1e-3;
    return (shown(kSource + kStep * direction, x, z) - shown(kSource - kStep * direction, x, z)) /
           (2.0 * kStep);
  };
  Picture value(sum_grid), along_x(sum_grid), along_z(sum_grid);
  SlabSumScratch scratch;
  SlabSum sum(sum_grid,
              kSource,
              {value.values.data(), along_x.values.data(), along_z.values.data()},
              scratch);
  for (const double plane : planes) {
    const NodeGrid grid = grid_at(plane, 1.05);
    const Picture image(grid,
                        plane < 0.0 ? std::function<double(double, double)>(cubic)
                                    : std::function<double(double, double)>(far_cubic));
    const Picture image_x(grid, slope_x), image_z(grid, slope_z);
    sum.add({grid, {image.values.data(), image_x.values.data(), image_z.values.data()}});
  }
  for (int t = 0; t < sum_grid.t_count; ++t)
    for (int s = 0; s < sum_grid.s_count; ++s) {
      const auto at = static_cast<std::size_t>(t * sum_grid.stride + s);
      const double x = sum_grid.s_first_mm + s * sum_grid.s_spacing_mm;
      const double z = sum_grid.t_first_mm + t * sum_grid.t_spacing_mm;
      // Single precision of values of about 5, and of their differences over 0.4 mm.
      ASSERT_NEAR(value.values[at], shown(kSource, x, z), 1e-5) << s << ' ' << t;
      ASSERT_NEAR(along_x.values[at], step({1, 0, 0}, x, z), 2e-5) << s << ' ' << t;
      ASSERT_NEAR(along_z.values[at], step({0, 0, 1}, x, z), 2e-5) << s << ' ' << t;
    }
}

TEST(SlabSum, GoesOnLinearlyBeyondASlab) {
  const auto plane = [](double x, double z) { return 1.0 + 0.1 * x - 0.2 * z; };
  const NodeGrid grid{0.0, 1.0, 0.0, 1.0, 0.0, 16, 3, 3};  // fewer than four nodes, too
  const NodeGrid wider{-0.5, 1.0, -0.5, 1.0, 0.0, 16, 4, 4};
  const Picture slab(grid, plane);
  const Picture expected(wider, plane);
  Picture sum(wider);
  SlabSumScratch scratch;
  SlabSum(wider, kSource, {sum.values.data(), nullptr, nullptr}, scratch)
      .add({grid, {slab.values.data(), nullptr, nullptr}});
  for (int t = 0; t < 4; ++t)
    for (int s = 0; s < 4; ++s) {
      const auto at = static_cast<std::size_t>(t * 16 + s);
      EXPECT_NEAR(sum.values[at], expected.values[at], 1e-6);
    }
}

}  // namespace
}  // namespace af
