// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/siddon_projector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

using Eigen::Vector3d;

// Sums of up to about 100 segments of lengths computed from t values up to 1000 mm: 100 * 1000 mm *
// 2^-53 is 1e-11 mm; relative attenuation is at most 3. The contract asks for 1e-4.
constexpr double kPathToleranceMm = 1e-9;
// bone_part() is stored as float: relative error 2^-24 of a path of up to 200 mm of bone.
constexpr double kSplitToleranceMm = 200.0 * 0x1.0p-24;

CtGrid oblique_grid(const std::array<int, 3>& size) {
  CtGrid grid;
  grid.size = size;
  grid.origin_mm = {-7.0, 4.0, 11.0};
  grid.spacing_mm = {0.8, 1.3, 2.1};
  grid.direction = Eigen::AngleAxisd(0.4, Vector3d(1.0, -2.0, 0.5).normalized()).toRotationMatrix();
  return grid;
}

CtVolume random_ct(const CtGrid& grid, std::uint64_t seed) {
  std::vector<std::int16_t> hu(grid.voxel_count());
  HashRandom random(seed);
  for (std::int16_t& value : hu) value = static_cast<std::int16_t>(random.uniform(-1000.0, 2000.0));
  return {grid, SharedArray<std::int16_t>(std::move(hu))};
}

/// Length of a half-line within voxel (i, j, k), by clipping against its six faces.
double chord_in_voxel_mm(const CtGrid& grid,
                         const Vector3d& voxel,
                         const Vector3d& source,
                         const Vector3d& through) {
  const Vector3d unit = (through - source).normalized();
  const Vector3d origin = grid.index_of(source);
  const Vector3d direction = (grid.direction.transpose() * unit).cwiseQuotient(grid.spacing_mm);
  double first = 0.0;
  double last = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double low = voxel[axis] - 0.5;
    const double high = voxel[axis] + 0.5;
    if (direction[axis] == 0.0) {
      if (origin[axis] < low || origin[axis] >= high) return 0.0;
      continue;
    }
    const double a = (low - origin[axis]) / direction[axis];
    const double b = (high - origin[axis]) / direction[axis];
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
  return std::max(0.0, last - first);
}

PathIntegrals brute_force(const CtVolume& ct,
                          const TissueModel& tissue,
                          const Vector3d& source,
                          const Vector3d& through) {
  PathIntegrals sum;
  std::size_t offset = 0;
  for (int k = 0; k < ct.grid.size[2]; ++k)
    for (int j = 0; j < ct.grid.size[1]; ++j)
      for (int i = 0; i < ct.grid.size[0]; ++i, ++offset) {
        const auto relative = tissue.attenuation_model().relative_attenuation(ct.hu[offset]);
        const double chord = chord_in_voxel_mm(ct.grid, Vector3d(i, j, k), source, through);
        const double bone = static_cast<double>(tissue.bone_part(relative));
        sum.bone_mm += chord * bone / 1000.0;
        sum.water_mm += chord * (relative - bone) / 1000.0;
      }
  return sum;
}

class SiddonProjectorOfABox : public ::testing::Test {
 protected:
  static CtGrid grid() {
    CtGrid grid;
    grid.size = {40, 30, 20};
    grid.spacing_mm = {1.0, 2.0, 3.0};
    return grid;
  }
  AttenuationModel model_;
  TissueModel tissue_{model_};
  // 500 HU in voxels 10 to 29, 5 to 14, 4 to 13: x in [9.5, 29.5], y in [9, 29], z in [10.5, 40.5].
  CtVolume ct_ = box_phantom(grid(), {10, 5, 4}, {29, 14, 13}, 500);
  AttenuationVolume volume_{ct_, model_};
  SiddonProjector projector_{volume_, tissue_};

  double total_mm(const Vector3d& source, const Vector3d& through) {
    const PathIntegrals path = projector_.integrate(source, through);
    return path.water_mm + path.bone_mm;
  }
};

TEST_F(SiddonProjectorOfABox, AxisParallelRaysMeasureTheSides) {
  EXPECT_NEAR(total_mm({-50, 20, 20}, {0, 20, 20}), 1.5 * 20.0, kPathToleranceMm);
  EXPECT_NEAR(total_mm({20, 200, 20}, {20, 0, 20}), 1.5 * 20.0, kPathToleranceMm);
  EXPECT_NEAR(total_mm({20, 20, -100}, {20, 20, 0}), 1.5 * 30.0, kPathToleranceMm);
}

TEST_F(SiddonProjectorOfABox, ObliqueRayMeasuresTheChord) {
  // Enters at x = 9.5 and leaves at y = 29 along (1, 1, 0) through (9.5, 14, 20): chord 15 sqrt 2.
  EXPECT_NEAR(
      total_mm({-10.5, -6, 20}, {9.5, 14, 20}), 1.5 * 15.0 * std::sqrt(2.0), kPathToleranceMm);
  // The space diagonal of the box, in both directions.
  const Vector3d low(9.5, 9.0, 10.5);
  const Vector3d high(29.5, 29.0, 40.5);
  const double diagonal = (high - low).norm();
  EXPECT_NEAR(total_mm(low - (high - low), high), 1.5 * diagonal, kPathToleranceMm);
  EXPECT_NEAR(total_mm(high + (high - low), low), 1.5 * diagonal, kPathToleranceMm);
}

TEST_F(SiddonProjectorOfABox, RayWithinAFaceBelongsToTheVoxelAbove) {
  EXPECT_NEAR(total_mm({-50, 9.0, 20}, {0, 9.0, 20}), 1.5 * 20.0, kPathToleranceMm);
  EXPECT_EQ(total_mm({-50, 29.0, 20}, {0, 29.0, 20}), 0.0);
}

TEST_F(SiddonProjectorOfABox, MissingAndBackwardRaysAreExactlyZero) {
  EXPECT_EQ(total_mm({-50, 100, 20}, {0, 100, 20}), 0.0);
  EXPECT_EQ(total_mm({-50, 20, 20}, {-51, 20, 20}), 0.0);  // the box lies behind the source
}

TEST_F(SiddonProjectorOfABox, SourceInsideStartsThere) {
  EXPECT_NEAR(total_mm({20, 20, 20}, {21, 20, 20}), 1.5 * 9.5, kPathToleranceMm);
}

TEST_F(SiddonProjectorOfABox, BoneShareFollowsTheMixtureModel) {
  const double hu_bone = tissue_.cortical_bone_hu();
  const double share = (500.0 - 100.0) / (hu_bone - 100.0);
  const PathIntegrals path = projector_.integrate({-50, 20, 20}, {0, 20, 20});
  EXPECT_NEAR(path.bone_mm, 20.0 * share * (1.0 + hu_bone / 1000.0), kSplitToleranceMm);
  EXPECT_NEAR(path.water_mm, 20.0 * (1.0 - share) * 1.1, kSplitToleranceMm);
}

TEST(SiddonProjector, EqualsBruteForceBoxClipping) {
  const CtVolume ct = random_ct(oblique_grid({9, 7, 6}), 11);
  const AttenuationModel model;
  const TissueModel tissue(model);
  const AttenuationVolume volume(ct, model);
  const SiddonProjector projector(volume, tissue);
  const Vector3d center = ct.grid.center_mm();
  HashRandom random(12);
  for (int n = 0; n < 2000; ++n) {
    const Vector3d source =
        center + 40.0 * Vector3d(random.normal(), random.normal(), random.normal());
    const Vector3d through =
        center + 5.0 * Vector3d(random.normal(), random.normal(), random.normal());
    const PathIntegrals path = projector.integrate(source, through);
    const PathIntegrals expected = brute_force(ct, tissue, source, through);
    ASSERT_NEAR(path.water_mm, expected.water_mm, kPathToleranceMm) << "ray " << n;
    ASSERT_NEAR(path.bone_mm, expected.bone_mm, kPathToleranceMm) << "ray " << n;
  }
}

TEST(SiddonProjector, EqualsBruteForceAlongVoxelAxesAndThroughCorners) {
  CtGrid grid;
  grid.size = {6, 6, 6};
  const CtVolume ct = random_ct(grid, 21);
  const AttenuationModel model;
  const TissueModel tissue(model);
  const AttenuationVolume volume(ct, model);
  const SiddonProjector projector(volume, tissue);
  // Lattice directions from far away through the middle of voxels: every crossing of the diagonal
  // ones is a voxel corner or edge, where three or two planes are met at once.
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        const Vector3d direction(x, y, z);
        if (direction.isZero()) continue;
        const Vector3d through(2.0, 3.0, 2.0);
        const Vector3d source = through - 20.0 * direction;
        const PathIntegrals path = projector.integrate(source, through);
        const PathIntegrals expected = brute_force(ct, tissue, source, through);
        EXPECT_NEAR(path.water_mm, expected.water_mm, kPathToleranceMm) << direction.transpose();
        EXPECT_NEAR(path.bone_mm, expected.bone_mm, kPathToleranceMm) << direction.transpose();
      }
}

TEST(SiddonProjector, SwappingTheEndsKeepsTheIntegral) {
  const CtVolume ct = random_ct(oblique_grid({15, 12, 10}), 31);
  const AttenuationModel model;
  const TissueModel tissue(model);
  const AttenuationVolume volume(ct, model);
  const SiddonProjector projector(volume, tissue);
  HashRandom random(32);
  for (int n = 0; n < 200; ++n) {
    const Vector3d direction(random.normal(), random.normal(), random.normal());
    const Vector3d middle =
        ct.grid.center_mm() + 3.0 * Vector3d(random.normal(), random.normal(), random.normal());
    const Vector3d a = middle - 100.0 * direction.normalized();
    const Vector3d b = middle + 100.0 * direction.normalized();
    EXPECT_NEAR(
        projector.integrate(a, b).water_mm, projector.integrate(b, a).water_mm, kPathToleranceMm);
  }
}

TEST(SiddonProjector, RefusesATissueModelOfAnotherScale) {
  CtGrid grid;
  grid.size = {4, 4, 4};
  const CtVolume ct = box_phantom(grid, {1, 1, 1}, {2, 2, 2}, 0);
  const AttenuationVolume volume(ct, {});
  AttenuationModel other;
  other.mu_water_per_mm = 0.019;
  const TissueModel tissue(other);
  EXPECT_ANY_THROW(SiddonProjector(volume, tissue));
}

}  // namespace
}  // namespace af
