// SPDX-License-Identifier: Apache-2.0
#include "ct/blurred_volume.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/vector_width.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

constexpr int kSide = 32;
constexpr int kLargestHu = 32767;

CtGrid uneven_grid() {
  CtGrid grid;
  grid.size = {kSide, kSide, kSide};
  grid.spacing_mm = {0.8, 1.1, 2.5};
  return grid;
}

/// Sums of value times x^0, x^1, x^2 over a line of voxels through the volume's middle, x in mm
/// along one axis of the ct frame.
std::array<double, 3> moments_along(const AttenuationVolume& volume, std::size_t axis) {
  const CtGrid& grid = volume.grid();
  std::array<int, 3> voxel{grid.size[0] / 2, grid.size[1] / 2, grid.size[2] / 2};
  std::array<double, 3> moments{};
  for (voxel[axis] = 0; voxel[axis] < grid.size[axis]; ++voxel[axis]) {
    const auto at =
        static_cast<std::size_t>((voxel[2] * grid.size[1] + voxel[1]) * grid.size[0] + voxel[0]);
    const Eigen::Vector3d index(voxel[0], voxel[1], voxel[2]);
    const double x = grid.point_mm(index)[static_cast<Eigen::Index>(axis)];
    for (std::size_t m = 0; m < 3; ++m)
      moments[m] += volume.voxels()[at] * std::pow(x, static_cast<double>(m));
  }
  return moments;
}

constexpr double kSigmaMm = 3.2;

/// `blur` must blur by kSigmaMm and round `roundings` times.
template <typename Blur>
void expect_variance(int roundings, const Blur& blur) {
  const std::array<int, 3> factors{2, 1, 1};  // 1.6 / 0.8, / 1.1 and / 2.5, rounded down
  // Rounding to integers of 33767: half a unit at up to 14 voxels to both sides, beyond which 4
  // sigma have passed on every axis.
  const double rounded_voxels2 = roundings * 2 * 0.5 * (14.0 * 15.0 * 29.0 / 6.0) / 33767.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // A plane one voxel thick, in every phase of the coarse voxels.
    std::array<double, 3> sums{};
    double center_mm = 0.0;
    double fine_mm = 0.0;
    double coarse_mm = 0.0;
    for (int phase = 0; phase < factors[axis]; ++phase) {
      std::array<int, 3> first{0, 0, 0};
      std::array<int, 3> last{kSide - 1, kSide - 1, kSide - 1};
      first[axis] = last[axis] = 14 + phase;
      const AttenuationVolume fine(box_phantom(uneven_grid(), first, last, kLargestHu), {});
      const auto coarse = blur(fine);
      fine_mm = fine.grid().spacing_mm[static_cast<Eigen::Index>(axis)];
      coarse_mm = coarse->grid().spacing_mm[static_cast<Eigen::Index>(axis)];
      EXPECT_NEAR(coarse_mm, factors[axis] * fine_mm, 1e-12);
      center_mm = (14 + phase) * fine_mm;
      const auto line = moments_along(*coarse, axis);
      sums[0] += line[0];
      sums[1] += line[1] - center_mm * line[0];
      sums[2] += line[2] - 2.0 * center_mm * line[1] + center_mm * center_mm * line[0];
    }
    const double mean_mm = sums[1] / sums[0];
    const double variance_mm2 = sums[2] / sums[0] - mean_mm * mean_mm;
    EXPECT_NEAR(mean_mm, 0.0, rounded_voxels2 * fine_mm) << axis;
    // Linear interpolation of voxels h apart adds h^2 / 6 on both sides.
    EXPECT_NEAR(variance_mm2 + coarse_mm * coarse_mm / 6.0,
                kSigmaMm * kSigmaMm + fine_mm * fine_mm / 6.0,
                rounded_voxels2 * fine_mm * fine_mm)
        << axis;
  }
}

TEST(VolumeBlur, SpreadsAVoxelByTheVariance) {
  expect_variance(1, [](const AttenuationVolume& fine) { return blurred_volume(fine, kSigmaMm); });
}

TEST(VolumeBlur, OfABlurredVolumeSpreadsAVoxelByTheVarianceOfBoth) {
  constexpr double kBelowMm = 1.6;
  expect_variance(2, [](const AttenuationVolume& fine) {
    return blurred_volume(*blurred_volume(fine, kBelowMm), kSigmaMm, kBelowMm);
  });
}

/// The volume's extents are no multiples of a vector's width.
TEST(VolumeBlur, EveryVectorWidthGivesTheSameBits) {
  const AttenuationVolume fine(box_phantom(uneven_grid(), {3, 4, 5}, {27, 24, 19}, 300), {});
  for (const double sigma_mm : {0.9, 2.7}) {
    const auto expected = blurred_volume(fine, sigma_mm);
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      EXPECT_TRUE(std::ranges::equal(blurred_volume(fine, sigma_mm)->voxels(), expected->voxels()));
    }
    force_vector_width(std::nullopt);
  }
}

TEST(VolumeBlur, KeepsTheIntegralAndItsBordersAreZero) {
  const CtVolume ct = box_phantom(uneven_grid(), {9, 10, 11}, {20, 22, 19}, 300);
  const AttenuationVolume fine(ct, {});
  for (const double sigma_mm : {0.3, 1.5, 4.0}) {
    const auto coarse = blurred_volume(fine, sigma_mm);
    const auto total = [](const AttenuationVolume& volume) {
      double sum = 0.0;
      for (const std::uint16_t voxel : volume.voxels()) sum += voxel;
      return sum * volume.grid().spacing_mm.prod();
    };
    // Rounding cuts tails below half a unit of 1300, beyond 3.4 sigma. A face loses 1e-4 sigma of
    // the extent there: 2e-4 in all at 4 mm, and several times that along the box's edges.
    EXPECT_NEAR(total(*coarse) / total(fine), 1.0, 1e-3) << sigma_mm;
    const auto& size = coarse->grid().size;
    std::size_t at = 0;
    for (int k = 0; k < size[2]; ++k)
      for (int j = 0; j < size[1]; ++j)
        for (int i = 0; i < size[0]; ++i, ++at) {
          const bool is_border = i == 0 || j == 0 || k == 0 || i == size[0] - 1 ||
                                 j == size[1] - 1 || k == size[2] - 1;
          if (is_border) {
            ASSERT_EQ(coarse->voxels()[at], 0) << sigma_mm;
          }
        }
  }
}

TEST(VolumeBlur, LeavesTheInsideOfALargeBodyAsItIs) {
  const CtVolume ct = box_phantom(uneven_grid(), {0, 0, 0}, {kSide - 1, kSide - 1, kSide - 1}, 700);
  const auto coarse = blurred_volume(AttenuationVolume(ct, {}), 3.0);
  const Eigen::Vector3d middle =
      coarse->grid().index_of(ct.grid.center_mm()).array().round().matrix();
  const auto& size = coarse->grid().size;
  const auto at =
      static_cast<std::size_t>((middle.z() * size[1] + middle.y()) * size[0] + middle.x());
  EXPECT_EQ(coarse->voxels()[at], 1700);
}

TEST(VolumeBlur, RefusesGridsThatNoCasterCanAddress) {
  CtGrid grid;
  grid.size = {2000, 2000, 530};
  EXPECT_THROW(VolumeBlur(grid, 1.5), InputError);
}

}  // namespace
}  // namespace af
