// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/depth_slabs.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "base/error.h"
#include "support/ct_phantoms.h"
#include "unit/precompute/casting/shear_warp_cases.h"

namespace af {
namespace {

/// Weighted squared distances from centroids of runs that begin at 0 and at `cuts`; infinite when a
/// run is empty.
double cost_of(const std::vector<std::int64_t>& sums, const std::vector<int>& cuts) {
  double cost = 0.0;
  for (std::size_t k = 0; k <= cuts.size(); ++k) {
    const int begin = k == 0 ? 0 : cuts[k - 1];
    const int end = k < cuts.size() ? cuts[k] : static_cast<int>(sums.size());
    double weight = 0.0;
    double centroid = 0.0;
    for (int y = begin; y < end; ++y) {
      weight += static_cast<double>(sums[static_cast<std::size_t>(y)]);
      centroid += static_cast<double>(sums[static_cast<std::size_t>(y)]) * y;
    }
    if (!(weight > 0.0)) return std::numeric_limits<double>::infinity();
    centroid /= weight;
    for (int y = begin; y < end; ++y)
      cost +=
          static_cast<double>(sums[static_cast<std::size_t>(y)]) * (y - centroid) * (y - centroid);
  }
  return cost;
}

TEST(DepthSlabs, CutIsTheBestOfAllCuts) {
  const std::vector<std::int64_t> sums = {0, 5, 80, 3, 0, 0, 40, 44, 90, 7, 1, 0, 200, 12};
  const auto slices = static_cast<int>(sums.size());
  double best = std::numeric_limits<double>::infinity();
  for (int a = 1; a < slices; ++a)
    for (int b = a + 1; b < slices; ++b) best = std::min(best, cost_of(sums, {a, b}));
  const std::vector<int> cuts = best_slice_cuts(sums, 3);
  ASSERT_EQ(cuts.size(), 2U);
  // Both sums have some 20 terms below 1e5: rounding stays far below this.
  EXPECT_NEAR(cost_of(sums, cuts), best, 1e-9 * best);
}

TEST(DepthSlabs, UniformSlicesAreCutIntoEqualParts) {
  EXPECT_EQ(best_slice_cuts(std::vector<std::int64_t>(40, 1000), 4),
            (std::vector<int>{10, 20, 30}));
}

TEST(DepthSlabs, EverySlabAttenuates) {
  std::vector<std::int64_t> sums(50, 0);
  sums[10] = 1;
  sums[11] = 1000000;
  sums[30] = 5;
  EXPECT_EQ(best_slice_cuts(sums, 3).front(), 11);
  EXPECT_THROW(best_slice_cuts(sums, 4), InputError);
  EXPECT_THROW(best_slice_cuts(sums, 0), InputError);
  EXPECT_THROW(best_slice_cuts(std::vector<std::int64_t>(50, -3), 1), InputError);
}

TEST(DepthSlabs, OneSlabIsThePapersField) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  RigidTransform slab_from_ct = RigidTransform::Identity();
  slab_from_ct.translation() = Eigen::Vector3d(0.0, 25.0, 0.0);
  const DepthSlabs slabs =
      choose_depth_slabs(SlabAlignedVolume(volume, slab_from_ct), 1, StPlane::Centre);
  EXPECT_TRUE(slabs.boundaries_y_mm.empty());
  EXPECT_EQ(slabs.st_plane_y_mm, (std::vector<double>{0.0}));
}

TEST(DepthSlabs, BoundariesLieBetweenSlicesAndPlanesAtCentroids) {
  // A box of 24 equal slices, 2 mm each, whose middle lies at y = 25 mm of the slab frame.
  const CtVolume ct =
      box_phantom(test::centered_grid({10, 30, 10}, {2.0, 2.0, 3.0}), {2, 3, 2}, {7, 26, 7}, 100);
  const AttenuationVolume volume(ct, AttenuationModel{});
  RigidTransform slab_from_ct = RigidTransform::Identity();
  slab_from_ct.translation() = Eigen::Vector3d(0.0, 25.0, 0.0);
  const DepthSlabs slabs =
      choose_depth_slabs(SlabAlignedVolume(volume, slab_from_ct), 3, StPlane::Centroid);
  // Slices stand a fifth of 2 mm before the voxels' planes, and the cuts lie midway between them.
  const double shift_mm = (0.5 - std::sqrt(1.0 / 12.0)) * 2.0;
  constexpr double kRoundingMm = 1e-9;
  ASSERT_EQ(slabs.boundaries_y_mm.size(), 2U);
  EXPECT_NEAR(slabs.boundaries_y_mm[0], 25.0 - 8.0 - shift_mm, kRoundingMm);
  EXPECT_NEAR(slabs.boundaries_y_mm[1], 25.0 + 8.0 - shift_mm, kRoundingMm);
  ASSERT_EQ(slabs.st_plane_y_mm.size(), 3U);
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(slabs.st_plane_y_mm[static_cast<std::size_t>(k)], 25.0 + 16.0 * (k - 1), shift_mm);
}

}  // namespace
}  // namespace af
