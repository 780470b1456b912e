// SPDX-License-Identifier: Apache-2.0
#include "drr/ray_by_ray_af_drr.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/vector_width.h"
#include "drr/two_pass_af_drr.h"
#include "support/central_differences.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

double multilinear(const RayNodes& n) {
  return 40 + 3 * n.u + 5 * n.v + 7 * n.s + 2 * n.t + n.u * n.s + 2 * n.v * n.t +
         n.u * n.v * n.s * n.t;
}

/// (u, v, s, t) of a pixel's ray by straight geometry, independent of the renderer's own path.
RayNodes nodes_of_pixel(const CompressedAttenuationField& field,
                        const RigidTransform& room_from_ct,
                        int column,
                        int row,
                        std::size_t k) {
  const RigidTransform slab_from_room = field.light_slab.slab_from_ct * room_from_ct.inverse();
  const Ray ray = small_camera().ray(column, row);
  return *field.light_slab.intersect(
      {slab_from_room * ray.origin_point, slab_from_room.linear() * ray.direction},
      field.light_slab.slabs[k]);
}

TEST(RayByRayAfDrr, ReproducesMultilinearFieldExactly) {
  for (const int slabs : {1, 3}) {
    const auto field = small_field(multilinear, slabs);
    const RayByRayAfDrr renderer(field, FieldInterpolation::Quadrilinear);
    const View view = View::whole_detector(small_camera());
    for (std::uint64_t i = 0; i < 10; ++i) {
      const RigidTransform pose = pose_from_parameters({}, small_pose(i));
      std::int64_t outside = -1;
      const Image2d image = render_image(renderer, pose, view, &outside);
      ASSERT_EQ(outside, 0);
      for (int row = 0; row < view.roi.height; ++row)
        for (int column = 0; column < view.roi.width; ++column) {
          double expected = 0.0;
          for (std::size_t k = 0; k < static_cast<std::size_t>(slabs); ++k)
            expected += 0.25 * multilinear(nodes_of_pixel(*field, pose, column, row, k));
          // Double arithmetic, stored as float.
          EXPECT_NEAR(image.at(column, row), expected, 4e-7 * expected);
        }
    }
  }
}

TEST(RayByRayAfDrr, NearestTakesTheClosestNode) {
  const auto field = small_field(multilinear, 1);
  const RayByRayAfDrr renderer(field, FieldInterpolation::Nearest);
  const View view = View::whole_detector(small_camera());
  const RigidTransform pose = pose_from_parameters({}, small_pose(3));
  const Image2d image = render_image(renderer, pose, view);
  for (int row = 0; row < view.roi.height; ++row)
    for (int column = 0; column < view.roi.width; ++column) {
      const RayNodes at = nodes_of_pixel(*field, pose, column, row, 0);
      const RayNodes rounded{
          std::round(at.u), std::round(at.v), std::round(at.s), std::round(at.t)};
      EXPECT_FLOAT_EQ(image.at(column, row), static_cast<float>(0.25 * multilinear(rounded)));
    }
}

TEST(RayByRayAfDrr, RegionOfInterestEqualsThatPartOfTheWholeImage) {
  const auto field = small_field(multilinear, 1);
  const RayByRayAfDrr renderer(field);
  const View whole = View::whole_detector(small_camera());
  const View part{small_camera(), {5, 7, 11, 9}};
  const RigidTransform pose = pose_from_parameters({}, small_pose(4));
  EXPECT_EQ(render_image(renderer, pose, part).pixels,
            crop(render_image(renderer, pose, whole), part.roi).pixels);
}

TEST(RayByRayAfDrr, RaysOutsideAreCountedAndNeverExtrapolated) {
  const auto field = small_field(multilinear, 1);
  const RayByRayAfDrr renderer(field);
  PoseParameters far;
  far.translation_mm = {150.0, 0.0, 0.0};
  std::int64_t outside = 0;
  const View view = View::whole_detector(small_camera());
  const Image2d image = render_image(renderer, pose_from_parameters({}, far), view, &outside);
  EXPECT_GT(outside, 0);
  std::int64_t zeros = 0;
  for (const float pixel : image.pixels)
    zeros += pixel == 0.0f ? 1 : 0;  // the field itself is positive everywhere
  EXPECT_EQ(zeros, outside);
}

TEST(RayByRayAfDrr, ValuesOutsideTheStoredRangeAreZero) {
  auto field = small_field([](const RayNodes&) { return 8.0; }, 1);
  auto cropped = std::make_shared<CompressedAttenuationField>(*field);
  SlabGeometry& slab = cropped->light_slab.slabs[0];
  slab.stored_s = {4, 2};
  std::vector<std::uint16_t> indices(static_cast<std::size_t>(cropped->lattice(0).tile_count()),
                                     std::uint16_t{1});
  cropped->slabs[0].indices = SharedArray<std::uint16_t>(indices);
  EXPECT_EQ(cropped->node_value(0, {0, 0, 3, 0}), 0.0f);
  EXPECT_EQ(cropped->node_value(0, {0, 0, 4, 0}), 2.0f);
  EXPECT_EQ(cropped->node_value(0, {0, 0, 5, 0}), 2.0f);
  EXPECT_EQ(cropped->node_value(0, {0, 0, 6, 0}), 0.0f);
}

TEST(RayByRayAfDrr, GradientsAgreeWithCentralDifferences) {
  // A field that is quadrilinear over the whole lattice is smooth, so that differences converge:
  // truncation error falls with step^2, single-precision noise of 1e-7 * U / step stays below 1e-4
  // of the gradients' scale.
  for (const int slabs : {1, 2}) {
    const auto field = small_field(multilinear, slabs);
    const RayByRayAfDrr renderer(field);
    const View view{small_camera(), {3, 2, 20, 15}};
    const RigidTransform pose = pose_from_parameters({}, small_pose(6));
    const auto workspace = renderer.make_workspace();
    std::vector<float> values(view.pixel_count());
    std::vector<float> analytic(6 * view.pixel_count());
    std::vector<float> differences(6 * view.pixel_count());
    const Eigen::Vector3d pivot(10.0, -20.0, 30.0);
    renderer.render(pose, view, *workspace, values, PoseGradients{pivot, analytic});
    test::central_difference_gradients(renderer, pose, view, *workspace, {pivot, differences});
    for (std::size_t parameter = 0; parameter < 6; ++parameter) {
      double error = 0.0;
      double norm = 0.0;
      for (std::size_t i = parameter * values.size(); i < (parameter + 1) * values.size(); ++i) {
        error +=
            std::pow(static_cast<double>(analytic[i]) - static_cast<double>(differences[i]), 2);
        norm += std::pow(static_cast<double>(differences[i]), 2);
      }
      constexpr double kRelativeTolerance = 2e-3;
      EXPECT_LT(std::sqrt(error / norm), kRelativeTolerance) << "parameter " << parameter;
    }
  }
}

/// Without u-s and v-t products a ray's value stays bilinear between (s,t) nodes, so both look-ups
/// must agree.
double without_cross_terms(const RayNodes& n) {
  return 40 + 3 * n.u + 5 * n.v + 7 * n.s + 2 * n.t + n.s * n.t + 2 * n.u * n.v + n.u * n.t +
         3 * n.v * n.s;
}

TEST(TwoPassAfDrr, AgreesWithQuadrilinearLookup) {
  for (const int slabs : {1, 3}) {
    const auto field = small_field(without_cross_terms, slabs, 6, 11);
    const RayByRayAfDrr exact(field);
    const TwoPassAfDrr two_pass(field);
    // A sum of slabs takes two more nodes on each side, and the viewpoints of nodes outside the
    // detector's rays are limited to the (u,v) rectangle.
    const std::vector<RegionOfInterest> regions =
        slabs == 1 ? std::vector<RegionOfInterest>{{0, 0, 31, 24}, {5, 3, 17, 1}, {30, 23, 1, 1}}
                   : std::vector<RegionOfInterest>{{8, 7, 15, 10}, {15, 12, 1, 1}};
    for (const RegionOfInterest& roi : regions) {
      const View view{small_camera(), roi};
      for (std::uint64_t i = 0; i < 10; ++i) {
        const RigidTransform pose = pose_from_parameters({}, small_pose(i));
        const Image2d expected = render_image(exact, pose, view);
        const Image2d image = render_image(two_pass, pose, view);
        // Single-precision node coordinates (10 nodes, 1e-6) times slopes of up to 60 levels of
        // 0.25.
        constexpr float kTolerance = 2e-4f;
        for (std::size_t p = 0; p < image.pixels.size(); ++p)
          EXPECT_NEAR(image.pixels[p], expected.pixels[p], kTolerance * expected.pixels[p]);
      }
    }
  }
}

TEST(TwoPassAfDrr, CountsAndBlanksTheSameRaysAsQuadrilinearLookup) {
  const auto field = small_field(without_cross_terms, 2);
  const View view = View::whole_detector(small_camera());
  const RigidTransform pose = pose_partly_outside();
  std::int64_t expected = 0;
  std::int64_t outside = 0;
  const Image2d exact = render_image(RayByRayAfDrr(field), pose, view, &expected);
  const Image2d image = render_image(TwoPassAfDrr(field), pose, view, &outside);
  EXPECT_GT(expected, 0);
  EXPECT_EQ(outside, expected);
  for (std::size_t p = 0; p < image.pixels.size(); ++p)
    EXPECT_EQ(image.pixels[p] == 0.0f, exact.pixels[p] == 0.0f);
}

TEST(CompressedAttenuationField, NamesWhatIsInconsistent) {
  const auto field = small_field(multilinear, 1);
  CompressedAttenuationField bad = *field;
  bad.codebook.codewords.resize(10);
  EXPECT_FALSE(problems(bad).empty());
  bad = *field;
  bad.slabs[0].indices = SharedArray<std::uint16_t>(std::vector<std::uint16_t>(3));
  EXPECT_FALSE(problems(bad).empty());
  bad = *field;
  bad.light_slab.slabs[0].stored_s = {1, 4};
  EXPECT_FALSE(problems(bad).empty());
}

}  // namespace
}  // namespace af
