// SPDX-License-Identifier: Apache-2.0
#include "ct/slice_stack.h"

#include <array>
#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "support/itk_resampling.h"

namespace af {
namespace {

/// Oblique axes, so that no index is a coordinate.
Eigen::Matrix3d oblique_axes() {
  return (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

/// A stack that leans by `lean_deg` along its rows' axis, with slices at `heights_mm`.
SliceStack leaning_stack(double lean_deg, const std::vector<double>& heights_mm) {
  SliceStack stack;
  stack.axes = oblique_axes();
  stack.spacing_mm = {0.8, 0.7};
  stack.columns = 40;
  stack.rows = 36;
  for (const double height : heights_mm)
    stack.origins_mm.emplace_back(
        stack.axes *
        Eigen::Vector3d(-12.0, 5.0 + std::tan(lean_deg * M_PI / 180.0) * height, -30.0 + height));
  return stack;
}

std::vector<double> even_heights(int count, double gap_mm) {
  std::vector<double> heights;
  for (int i = 0; i < count; ++i) heights.push_back(gap_mm * i);
  return heights;
}

/// HU of a stack whose voxels hold a function of the point.
template <typename Function>
std::vector<std::int16_t> values_of(const SliceStack& stack, const Function& hu_at) {
  std::vector<std::int16_t> values;
  for (const Eigen::Vector3d& origin : stack.origins_mm)
    for (int row = 0; row < stack.rows; ++row)
      for (int column = 0; column < stack.columns; ++column)
        values.push_back(static_cast<std::int16_t>(std::nearbyint(
            hu_at(origin + stack.axes * Eigen::Vector3d(column * stack.spacing_mm.x(),
                                                        row * stack.spacing_mm.y(),
                                                        0.0)))));
  return values;
}

/// Trilinear interpolation is exact for a linear function; both roundings are to whole HU.
constexpr double kTwoRoundings = 1.0 + 1e-9;

template <typename Function>
std::size_t expect_function(const SliceStack& stack, const Function& hu_at, double tolerance_hu) {
  const CtGrid grid = upright_grid(stack);
  const std::vector<std::int16_t> values = resampled(stack, values_of(stack, hu_at), grid);
  std::size_t compared = 0;
  std::size_t at = 0;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i, ++at) {
        if (values[at] == -1000) continue;  // beside the slices
        ++compared;
        EXPECT_NEAR(values[at], hu_at(grid.point_mm(Eigen::Vector3d(i, j, k))), tolerance_hu)
            << i << ' ' << j << ' ' << k;
      }
  return compared;
}

test::ItkImageGrid itk_grid(const std::array<int, 3>& size,
                            const Eigen::Vector3d& origin_mm,
                            const Eigen::Vector3d& spacing_mm,
                            const Eigen::Matrix3d& direction) {
  test::ItkImageGrid grid;
  grid.size = size;
  for (std::size_t row = 0; row < 3; ++row) {
    const auto r = static_cast<Eigen::Index>(row);
    grid.origin_mm[row] = origin_mm[r];
    grid.spacing_mm[row] = spacing_mm[r];
    for (std::size_t column = 0; column < 3; ++column)
      grid.direction[row][column] = direction(r, static_cast<Eigen::Index>(column));
  }
  return grid;
}

double ramp_hu(const Eigen::Vector3d& point) {
  return 100.0 + Eigen::Vector3d(3.0, -4.0, 5.0).dot(point);
}

TEST(SliceStack, OfATiltedGantryGivesALinearFunctionBackExactly) {
  for (const double lean_deg : {-20.0, 12.5, 30.0}) {
    const SliceStack stack = leaning_stack(lean_deg, even_heights(12, 2.0));
    const std::size_t compared = expect_function(stack, ramp_hu, kTwoRoundings);
    EXPECT_GT(compared, 11u * 39u * 35u) << "nearly every stored pixel has a place";
  }
}

TEST(SliceStack, OfUnevenSlicesGivesALinearFunctionBackExactly) {
  const SliceStack stack = leaning_stack(0.0, {0.0, 2.0, 4.1, 6.0, 9.0, 11.0, 13.0, 14.5});
  const CtGrid grid = upright_grid(stack);
  EXPECT_EQ(grid.size, (std::array<int, 3>{40, 36, 8}));
  EXPECT_NEAR(grid.spacing_mm.z(), 14.5 / 7.0, 1e-12);
  EXPECT_EQ(expect_function(stack, ramp_hu, kTwoRoundings), 40u * 36u * 8u);
}

TEST(SliceStack, PutsASphereWhereItIs) {
  // A sphere of 9 mm voxelised on the tilted stack: on the upright grid its centre of mass and its
  // volume are those of the sphere.
  const SliceStack stack = leaning_stack(18.0, even_heights(30, 1.0));
  const CtGrid grid = upright_grid(stack);
  const Eigen::Vector3d center = grid.center_mm();
  const auto sphere = [&](const Eigen::Vector3d& point) {
    // Smooth over a voxel, as scanners are.
    return -1000.0 + 1400.0 / (1.0 + std::exp(((point - center).norm() - 9.0) / 0.5));
  };
  const std::vector<std::int16_t> values = resampled(stack, values_of(stack, sphere), grid);
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  double mass = 0.0;
  double wanted = 0.0;
  std::size_t at = 0;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i, ++at) {
        const Eigen::Vector3d point = grid.point_mm(Eigen::Vector3d(i, j, k));
        moment += (values[at] + 1000.0) * (point - center);
        mass += values[at] + 1000.0;
        wanted += sphere(point) + 1000.0;
      }
  EXPECT_LT((moment / mass).norm(), 0.01) << "mm";
  EXPECT_NEAR(mass / wanted, 1.0, 2e-3);
}

TEST(SliceStack, AgreesWithItksResamplerOfTheSameLeaningImage) {
  const SliceStack stack = leaning_stack(14.0, even_heights(10, 1.7));
  std::mt19937 random(3);
  std::vector<std::int16_t> hu(static_cast<std::size_t>(stack.columns) *
                               static_cast<std::size_t>(stack.rows) * stack.origins_mm.size());
  for (std::int16_t& value : hu) value = static_cast<std::int16_t>(random() % 3000);
  const CtGrid grid = upright_grid(stack);
  const std::vector<std::int16_t> ours = resampled(stack, hu, grid);
  // ITK's image leans as the stack does: its third axis is the way from slice to slice.
  const Eigen::Vector3d step = stack.origins_mm[1] - stack.origins_mm[0];
  Eigen::Matrix3d leaning = stack.axes;
  leaning.col(2) = step.normalized();
  const std::vector<double> theirs = test::itk_resampled(
      itk_grid({stack.columns, stack.rows, static_cast<int>(stack.origins_mm.size())},
               stack.origins_mm[0],
               {stack.spacing_mm.x(), stack.spacing_mm.y(), step.norm()},
               leaning),
      {hu.begin(), hu.end()},
      itk_grid(grid.size, grid.origin_mm, grid.spacing_mm, grid.direction),
      -1000.0);
  ASSERT_EQ(ours.size(), theirs.size());
  std::size_t beside = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    // Ours ends at the outermost pixel centres; ITK's continues half a pixel by replication.
    if (ours[i] == -1000 && theirs[i] != -1000.0) {
      ++beside;
      continue;
    }
    ASSERT_NEAR(ours[i], theirs[i], 0.5 + 1e-6) << i;
  }
  EXPECT_LT(beside, ours.size() / 20);
}

}  // namespace
}  // namespace af
