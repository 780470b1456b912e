// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/slab_aligned_volume.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/vector_width.h"
#include "support/ct_phantoms.h"
#include "unit/precompute/casting/shear_warp_cases.h"

namespace af {
namespace {

RigidTransform rotated(const Eigen::Matrix3d& rotation) {
  RigidTransform slab_from_ct = RigidTransform::Identity();
  slab_from_ct.linear() = rotation;
  slab_from_ct.translation() = Eigen::Vector3d(7.0, -3.0, 11.0);
  return slab_from_ct;
}

/// Levels of all nodes, [y][z][x].
std::vector<std::int16_t> levels_of(const SlabAlignedVolume& volume) {
  const SlabAlignedGrid& grid = volume.grid();
  std::vector<std::int16_t> levels;
  levels.reserve(grid.row_count() * static_cast<std::size_t>(grid.size[0]));
  for (int y = 0; y < grid.size[1]; ++y)
    for (int z = 0; z < grid.size[2]; ++z)
      for (int x = 0; x < grid.size[0]; ++x) levels.push_back(volume.level(x, y, z));
  return levels;
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
          ASSERT_NEAR(resampled.level(x, y, z),
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
    const SlabAlignedGrid grid =
        slab_aligned_layout(volume, rotated(rotation_from_angles(angles))).grid;
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
          ASSERT_NEAR(resampled.level(x, y, z),
                      (1000.0 + hu(point)) * scale,
                      kRoundingLevels + kHuRounding * scale);
          ++compared;
        }
    EXPECT_GT(compared, 100000);
  }
}

TEST(SlabAlignedVolume, HasZerosOnItsFacesAndKnowsWhereRowsBeginAndEnd) {
  const CtVolume ct = box_phantom(
      test::centered_grid({24, 25, 26}, {1.0, 1.0, 1.0}), {0, 0, 0}, {23, 24, 25}, 3071);
  const AttenuationVolume volume(ct, AttenuationModel{});
  for (const Eigen::Matrix3d& rotation : test::all_rotations()) {
    const SlabAlignedVolume resampled(volume, rotated(rotation));
    const SlabAlignedGrid& grid = resampled.grid();
    for (int y = 0; y < grid.size[1]; ++y)
      for (int z = 0; z < grid.size[2]; ++z) {
        const GridRow& row = resampled.row(y, z);
        if (row.begin == row.end) continue;
        const bool is_face = y == 0 || y == grid.size[1] - 1 || z == 0 || z == grid.size[2] - 1;
        ASSERT_FALSE(is_face);
        ASSERT_GT(row.begin, 0);
        ASSERT_LT(row.end, grid.size[0]);
        EXPECT_NE(resampled.level(row.begin, y, z), 0);
        EXPECT_NE(resampled.level(row.end - 1, y, z), 0);
        // Casters read whole blocks.
        const std::int16_t* levels = resampled.values() + row.origin_offset();
        for (int x = kRowBlock * row.first_block(); x < kRowBlock * row.end_block(); ++x)
          if (x < row.begin || x >= row.end) {
            ASSERT_EQ(levels[x], 0);
          }
      }
  }
}

SlabAlignedMemory filled_in_parts(int parts) {
  return [parts](std::size_t bytes, const SlabAlignedFill& fill) {
    const std::shared_ptr<std::byte[]> memory(new std::byte[bytes]);
    for (int part = 0; part < parts; ++part) fill({memory.get(), bytes}, part, parts);
    return std::shared_ptr<const std::byte>(memory, memory.get());
  };
}

/// Levels when every node of the grid is stored, as if nothing were known of where the volume
/// attenuates.
SlabAlignedVolume resampled_with_all_nodes(const AttenuationVolume& volume,
                                           const RigidTransform& slab_from_ct) {
  SlabAlignedLayout layout = slab_aligned_layout(volume, slab_from_ct);
  const SlabAlignedGrid& grid = layout.grid;
  std::int32_t blocks = 0;
  for (int y = 0; y < grid.size[1]; ++y)
    for (int z = 0; z < grid.size[2]; ++z) {
      const bool is_face = y == 0 || y == grid.size[1] - 1;
      GridRow& row = layout.rows[grid.row_index(y, z)];
      row = {blocks, 0, static_cast<std::int16_t>(is_face ? 0 : grid.size[0])};
      blocks += row.end_block();
    }
  layout.value_count = static_cast<std::size_t>(blocks) * kRowBlock;
  return {volume, slab_from_ct, layout, filled_in_parts(1)};
}

TEST(SlabAlignedVolume, StoresAllThatIsNotZero) {
  // Two bodies that leave much air in and around the box that holds them.
  CtVolume ct =
      box_phantom(test::centered_grid({40, 44, 36}, {1.0, 0.9, 1.1}), {3, 4, 5}, {3, 4, 5}, 3071);
  const CtVolume other = box_phantom(ct.grid, {20, 25, 20}, {34, 36, 30}, 1200);
  std::vector<std::int16_t> hu(ct.hu.view().begin(), ct.hu.view().end());
  for (std::size_t i = 0; i < hu.size(); ++i) hu[i] = std::max(hu[i], other.hu[i]);
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  const AttenuationVolume volume(ct, AttenuationModel{});
  for (const Eigen::Matrix3d& rotation : test::all_rotations()) {
    const SlabAlignedVolume resampled(volume, rotated(rotation));
    const SlabAlignedVolume all = resampled_with_all_nodes(volume, rotated(rotation));
    EXPECT_EQ(levels_of(resampled), levels_of(all));
    EXPECT_LT(resampled.bytes(), all.bytes() * 3 / 4);
  }
}

TEST(SlabAlignedVolume, DoesNotDependOnThePiecesOrTheVectorWidth) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  for (const Eigen::Matrix3d& rotation : test::all_rotations()) {
    const RigidTransform slab_from_ct = rotated(rotation);
    const SlabAlignedVolume whole(volume, slab_from_ct);
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      const SlabAlignedVolume pieced(
          volume, slab_from_ct, slab_aligned_layout(volume, slab_from_ct), filled_in_parts(7));
      EXPECT_EQ(levels_of(pieced), levels_of(whole)) << to_string(width);
      EXPECT_EQ(pieced.slice_sums(), whole.slice_sums());
    }
    force_vector_width(std::nullopt);
  }
}

TEST(SlabAlignedLayout, PartsCoverAllSlicesAndAreAboutEven) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  const SlabAlignedLayout layout =
      slab_aligned_layout(volume, rotated(test::oblique_rotations()[0]));
  const auto end_value_of = [&](int y) {
    const GridRow& row = layout.rows[layout.grid.row_index(y, layout.grid.size[2] - 1)];
    return static_cast<double>(row.origin_offset() + kRowBlock * row.end_block());
  };
  double largest_slice = 0.0;
  for (int y = 1; y < layout.grid.size[1]; ++y)
    largest_slice = std::max(largest_slice, end_value_of(y) - end_value_of(y - 1));
  for (const int parts : {1, 2, 3, 7, 400}) {
    EXPECT_EQ(layout.part_begin(0, parts), 0);
    EXPECT_EQ(layout.part_begin(parts, parts), layout.grid.size[1]);
    for (int part = 0; part < parts; ++part) {
      const int begin = layout.part_begin(part, parts);
      const int end = layout.part_begin(part + 1, parts);
      ASSERT_LE(begin, end);
      const double values =
          end > begin ? end_value_of(end - 1) - (begin > 0 ? end_value_of(begin - 1) : 0.0) : 0.0;
      EXPECT_LE(values, static_cast<double>(layout.value_count) / parts + largest_slice);
    }
  }
}

TEST(SlabAlignedVolume, NoColumnOfLargestLevelsOverflowsTheCastersSums) {
  const CtVolume ct = box_phantom(
      test::centered_grid({20, 300, 20}, {1.0, 1.0, 1.0}), {0, 0, 0}, {19, 299, 19}, 32767);
  const AttenuationVolume volume(ct, AttenuationModel{});
  for (const Eigen::Matrix3d& rotation : test::all_rotations()) {
    const SlabAlignedVolume resampled(volume, rotated(rotation));
    std::int64_t sum = 0;
    const SlabAlignedGrid& grid = resampled.grid();
    for (int y = 0; y < grid.size[1]; ++y) {
      std::int16_t largest = 0;
      for (int z = 0; z < grid.size[2]; ++z)
        for (int x = 0; x < grid.size[0]; ++x)
          largest = std::max(largest, resampled.level(x, y, z));
      sum += largest;
    }
    EXPECT_LE(sum * 256, std::numeric_limits<std::int32_t>::max());
    EXPECT_GT(sum * 256, std::numeric_limits<std::int32_t>::max() / 50);
  }
}

TEST(SlabAlignedVolume, CoarsensAnObliqueGridToTheMemoryAllowed) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  SlabAlignedOptions options;
  options.largest_bytes = 2'000'000;
  const SlabAlignedLayout layout =
      slab_aligned_layout(volume, rotated(test::oblique_rotations()[0]), options);
  EXPECT_LE(layout.bytes(), options.largest_bytes);
  EXPECT_GT(layout.bytes(), options.largest_bytes * 3 / 4);
}

TEST(SlabAlignedVolume, RefusesASpacingOutOfRange) {
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  for (const double spacing : {0.0, 0.05, 1.5, std::nan("")})
    for (const SlabAlignedOptions& options :
         {SlabAlignedOptions{spacing, 0.5, 0}, SlabAlignedOptions{0.5, spacing, 0}})
      EXPECT_THROW(slab_aligned_layout(volume, RigidTransform::Identity(), options), InputError);
}

}  // namespace
}  // namespace af
