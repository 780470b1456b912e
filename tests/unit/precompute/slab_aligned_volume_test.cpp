// SPDX-License-Identifier: Apache-2.0
#include "precompute/slab_aligned_volume.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/vector_width.h"
#include "unit/precompute/shear_warp_cases.h"
#include "volume/phantoms.h"

namespace af {
namespace {

RigidTransform rotated(const Eigen::Matrix3d& rotation) {
  RigidTransform slab_from_ct = RigidTransform::Identity();
  slab_from_ct.linear() = rotation;
  slab_from_ct.translation() = Eigen::Vector3d(7.0, -3.0, 11.0);
  return slab_from_ct;
}

std::vector<Eigen::Matrix3d> all_rotations() {
  auto rotations = test::aligned_rotations();
  for (const auto& oblique : test::oblique_rotations()) rotations.push_back(oblique);
  return rotations;
}

std::vector<std::int16_t> values_of(const SlabAlignedVolume& volume) {
  const std::size_t count = volume.grid().slice_offset(volume.grid().size[1]);
  return {volume.slice(0), volume.slice(0) + count};
}

TEST(SlabAlignedVolume, HoldsMeansOfTwoVoxelsWhenAxesAgree) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  const auto& size = volume.grid().size;
  const auto voxel = [&](const Eigen::Vector3d& index) {
    const auto i = static_cast<std::size_t>(std::lround(index.x()));
    const auto j = static_cast<std::size_t>(std::lround(index.y()));
    const auto k = static_cast<std::size_t>(std::lround(index.z()));
    return static_cast<double>(volume.voxels()[(k * static_cast<std::size_t>(size[1]) + j) *
                                                   static_cast<std::size_t>(size[0]) +
                                               i]);
  };
  for (const Eigen::Matrix3d& rotation : test::aligned_rotations()) {
    const RigidTransform slab_from_ct = rotated(rotation);
    const SlabAlignedVolume resampled(volume, slab_from_ct);
    const SlabAlignedGrid& grid = resampled.grid();
    EXPECT_FALSE(grid.is_oblique());
    const auto slices = static_cast<std::size_t>(grid.size[1]);
    EXPECT_EQ(static_cast<std::size_t>(grid.size[0]) * grid.row_count() / slices * (slices - 1),
              volume.grid().voxel_count());
    // Slice y stands a fifth of a cell (the lower Gauss-Legendre point of [0, 1]) before plane y.
    const double from_previous = 0.5 - std::sqrt(1.0 / 12.0);
    for (int y = 1; y + 1 < grid.size[1]; ++y)
      for (int z = 0; z < grid.size[2]; ++z)
        for (int x = 0; x < grid.size[0]; ++x) {
          const Eigen::Vector3d plane =
              grid.origin_mm +
              grid.spacing_mm.cwiseProduct(Eigen::Vector3d(x, y + from_previous, z));
          const Eigen::Vector3d index = volume.grid().index_of(slab_from_ct.inverse() * plane);
          const Eigen::Vector3d previous = volume.grid().index_of(
              slab_from_ct.inverse() * (plane - Eigen::Vector3d(0.0, grid.spacing_mm.y(), 0.0)));
          const double expected =
              (1.0 - from_previous) * voxel(index) + from_previous * voxel(previous);
          // Half a level of rounding, and positions in single precision.
          constexpr double kTolerance = 0.5 + 0.02;
          ASSERT_NEAR(resampled.slice(y)[z * grid.row_stride + x],
                      expected * static_cast<double>(grid.levels_per_unit),
                      kTolerance);
        }
  }
}

TEST(SlabAlignedVolume, KeepsTheNodesOfTheAxisThatACameraIsTurnedAbout) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3d angles = Eigen::Vector3d::Zero();
    angles[axis] = 0.6;
    const SlabAlignedGrid grid = slab_aligned_grid(volume, rotated(rotation_from_angles(angles)));
    for (int other = 0; other < 3; ++other)
      EXPECT_EQ(grid.is_resampled[static_cast<std::size_t>(other)], other != axis);
    EXPECT_NEAR(grid.spacing_mm[axis], volume.grid().spacing_mm[axis], 1e-9);
  }
}

TEST(SlabAlignedVolume, ObliqueGridReproducesALinearRamp) {
  // Trilinear interpolation and sharpening both keep linear functions, so deep inside the volume
  // only rounding is left: half a level twice, the second of which the filter's gain of 2.3 widens.
  constexpr double kRoundingLevels = 0.5 * 2.3 + 0.5;
  // HU are rounded to integers, which the filter widens too.
  constexpr double kHuRounding = 0.5 * 2.3;
  const auto hu = [](const Eigen::Vector3d& point) {
    return 200.0 + 7.0 * point.x() - 5.0 * point.y() + 3.0 * point.z();
  };
  const CtVolume ct = test::ct_of(test::centered_grid({41, 43, 45}, {1.0, 1.1, 1.2}), hu);
  const AttenuationVolume volume(ct, AttenuationModel{});
  for (const Eigen::Matrix3d& rotation : test::oblique_rotations()) {
    const RigidTransform slab_from_ct = rotated(rotation);
    const SlabAlignedVolume resampled(volume, slab_from_ct);
    const SlabAlignedGrid& grid = resampled.grid();
    EXPECT_TRUE(grid.is_oblique());
    int compared = 0;
    for (int y = 0; y < grid.size[1]; ++y)
      for (int z = 0; z < grid.size[2]; ++z)
        for (int x = 0; x < grid.size[0]; ++x) {
          const Eigen::Vector3d point =
              slab_from_ct.inverse() *
              (grid.slice_origin_mm(y) +
               Eigen::Vector3d(grid.spacing_mm.x() * x, 0.0, grid.spacing_mm.z() * z));
          if (point.cwiseAbs().maxCoeff() > 16.0) continue;
          const double scale = static_cast<double>(grid.levels_per_unit);
          ASSERT_NEAR(resampled.slice(y)[z * grid.row_stride + x],
                      (1000.0 + hu(point)) * scale,
                      kRoundingLevels + kHuRounding * scale);
          ++compared;
        }
    EXPECT_GT(compared, 100000);
  }
}

TEST(SlabAlignedVolume, HasZerosOnItsFacesAndOutsideTheOccupiedRanges) {
  const CtVolume ct = box_phantom(
      test::centered_grid({24, 25, 26}, {1.0, 1.0, 1.0}), {0, 0, 0}, {23, 24, 25}, 3071);
  const AttenuationVolume volume(ct, AttenuationModel{});
  for (const Eigen::Matrix3d& rotation : all_rotations()) {
    const SlabAlignedVolume resampled(volume, rotated(rotation));
    const SlabAlignedGrid& grid = resampled.grid();
    for (int y = 0; y < grid.size[1]; ++y)
      for (int z = 0; z < grid.size[2]; ++z) {
        const OccupiedRange range = resampled.occupied(y, z);
        const std::int16_t* row = resampled.slice(y) + z * grid.row_stride;
        for (int x = 0; x < grid.row_stride; ++x) {
          if (x < range.begin || x >= range.end) {
            ASSERT_EQ(row[x], 0);
          }
          const bool is_face = x == 0 || x >= grid.size[0] - 1 || y == 0 || y == grid.size[1] - 1 ||
                               z == 0 || z == grid.size[2] - 1;
          if (is_face) {
            ASSERT_EQ(row[x], 0);
          }
        }
        if (range.begin < range.end) {
          EXPECT_NE(row[range.begin], 0);
          EXPECT_NE(row[range.end - 1], 0);
        }
      }
  }
}

TEST(SlabAlignedVolume, DoesNotDependOnThePiecesOrTheVectorWidth) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  for (const Eigen::Matrix3d& rotation : all_rotations()) {
    const RigidTransform slab_from_ct = rotated(rotation);
    const SlabAlignedVolume whole(volume, slab_from_ct);
    const SlabAlignedGrid grid = slab_aligned_grid(volume, slab_from_ct);
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      std::vector<std::int16_t> values(grid.value_count());
      std::vector<OccupiedRange> occupied(grid.row_count());
      const auto z_rows = static_cast<std::size_t>(grid.size[2]);
      for (int first = 0; first < grid.size[1]; first += 7) {
        const int end = std::min(first + 7, grid.size[1]);
        const auto slices = static_cast<std::size_t>(end - first);
        fill_slices(
            volume,
            slab_from_ct,
            grid,
            first,
            end,
            std::span(values).subspan(grid.slice_offset(first)),
            std::span(occupied).subspan(static_cast<std::size_t>(first) * z_rows, slices * z_rows));
      }
      const SlabAlignedVolume pieced(grid,
                                     volume.model(),
                                     SharedArray<std::int16_t>(std::move(values)),
                                     SharedArray<OccupiedRange>(std::move(occupied)));
      EXPECT_EQ(values_of(pieced), values_of(whole)) << to_string(width);
      EXPECT_EQ(pieced.slice_sums(), whole.slice_sums());
    }
    force_vector_width(std::nullopt);
  }
}

TEST(SlabAlignedVolume, NoColumnOfLargestLevelsOverflowsTheCastersSums) {
  const CtVolume ct = box_phantom(
      test::centered_grid({20, 300, 20}, {1.0, 1.0, 1.0}), {0, 0, 0}, {19, 299, 19}, 32767);
  const AttenuationVolume volume(ct, AttenuationModel{});
  for (const Eigen::Matrix3d& rotation : all_rotations()) {
    const SlabAlignedVolume resampled(volume, rotated(rotation));
    std::int64_t sum = 0;
    const SlabAlignedGrid& grid = resampled.grid();
    const auto slice_values = static_cast<std::ptrdiff_t>(grid.slice_offset(1));
    for (int y = 0; y < grid.size[1]; ++y)
      sum += *std::max_element(resampled.slice(y), resampled.slice(y) + slice_values);
    EXPECT_LE(sum * 256, std::numeric_limits<std::int32_t>::max());
    EXPECT_GT(sum * 256, std::numeric_limits<std::int32_t>::max() / 50);
  }
}

TEST(SlabAlignedVolume, CoarsensAnObliqueGridToTheMemoryAllowed) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  SlabAlignedOptions options;
  options.largest_bytes = 2'000'000;
  const SlabAlignedGrid grid =
      slab_aligned_grid(volume, rotated(test::oblique_rotations()[0]), options);
  EXPECT_LE(grid.value_count() * sizeof(std::int16_t), options.largest_bytes);
  EXPECT_GT(grid.value_count() * sizeof(std::int16_t), options.largest_bytes * 3 / 4);
}

TEST(SlabAlignedVolume, RefusesASpacingOutOfRange) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  for (const double spacing : {0.0, 0.05, 1.5, std::nan("")})
    EXPECT_THROW(slab_aligned_grid(volume, RigidTransform::Identity(), {spacing}), InputError);
}

}  // namespace
}  // namespace af
