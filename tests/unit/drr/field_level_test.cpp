// SPDX-License-Identifier: Apache-2.0
#include "drr/field_level.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/vector_width.h"
#include "drr/two_pass_af_drr.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

/// Integer noise over the whole 16-bit range, the same for the same node.
double noise(const RayNodes& n) {
  const auto index = static_cast<std::uint64_t>(((n.u * 100 + n.v) * 100 + n.s) * 100 + n.t);
  return std::floor(HashRandom(5, index).uniform(0, 65535));
}

/// A field of noise whose slab is cropped.
std::shared_ptr<CompressedAttenuationField> cropped_noise(int st_nodes,
                                                          const NodeRange& s,
                                                          const NodeRange& t) {
  auto field = small_field(noise, 1, 5, st_nodes);
  crop_stored(*field, s, t);
  return field;
}

/// A level's sample by its node on the level's lattice; 0 where nothing is stored.
int sample(const FieldLevel& level, const NodeIndex& node) {
  const FieldLevelSlab& slab = level.slabs[0];
  const NodeRange& s = slab.geometry.stored_s;
  const NodeRange& t = slab.geometry.stored_t;
  if (node.s < s.begin || node.s >= s.end() || node.t < t.begin || node.t >= t.end()) return 0;
  const int viewpoint = node.u * level.field_geometry.v.nodes + node.v;
  const int index = (viewpoint * t.count + node.t - t.begin) * s.count + node.s - s.begin;
  return slab.samples.view()[static_cast<std::size_t>(index)];
}

/// Level + 1 by the definition: (1 3 3 1)/8 on both axes, replicated beyond the lattice.
int halved_sample(const FieldLevel& level, const NodeIndex& node) {
  constexpr std::array<int, 4> kWeights{1, 3, 3, 1};
  const SlabGeometry& geometry = level.slabs[0].geometry;
  int sum = 0;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      const NodeIndex fine{node.u,
                           node.v,
                           std::clamp(2 * node.s - 1 + i, 0, geometry.s.nodes - 1),
                           std::clamp(2 * node.t - 1 + j, 0, geometry.t.nodes - 1)};
      sum += kWeights[static_cast<std::size_t>(i)] * kWeights[static_cast<std::size_t>(j)] *
             sample(level, fine);
    }
  return (sum + 32) / 64;
}

void expect_halved(const FieldLevel& fine, const FieldLevel& coarse) {
  const SlabGeometry& geometry = coarse.slabs[0].geometry;
  EXPECT_EQ(coarse.level, fine.level + 1);
  ASSERT_EQ(geometry.s.nodes, (fine.slabs[0].geometry.s.nodes + 1) / 2);
  for (int u = 0; u < coarse.field_geometry.u.nodes; ++u)
    for (int v = 0; v < coarse.field_geometry.v.nodes; ++v)
      for (int s = 0; s < geometry.s.nodes; ++s)
        for (int t = 0; t < geometry.t.nodes; ++t)
          ASSERT_EQ(sample(coarse, {u, v, s, t}), halved_sample(fine, {u, v, s, t}))
              << u << ' ' << v << ' ' << s << ' ' << t;
}

struct Crop {
  int st_nodes;
  NodeRange s, t;
};

TEST(FieldLevel, HalvingTakesBinomialWeights) {
  for (const Crop& crop : {Crop{11, {0, 11}, {0, 11}},
                           Crop{12, {0, 12}, {0, 12}},
                           Crop{11, {2, 9}, {4, 4}},
                           Crop{16, {4, 8}, {6, 6}}}) {
    const auto field = cropped_noise(crop.st_nodes, crop.s, crop.t);
    const FieldLevel level_0 = decode_field(field);
    const auto pyramid = make_field_pyramid(field, 2);
    ASSERT_EQ(pyramid.size(), 2u);
    expect_halved(level_0, *pyramid[0]);
    expect_halved(*pyramid[0], *pyramid[1]);
  }
}

TEST(FieldLevel, LevelZeroHasTheFieldsSamples) {
  const auto field = cropped_noise(11, {2, 9}, {4, 4});
  const FieldLevel level = decode_field(field);
  for (int u = 0; u < 5; ++u)
    for (int v = 0; v < 5; ++v)
      for (int s = 0; s < 11; ++s)
        for (int t = 0; t < 11; ++t)
          ASSERT_EQ(level.quantizer_step * static_cast<float>(sample(level, {u, v, s, t})),
                    field->node_value(0, {u, v, s, t}));
}

TEST(FieldLevel, IsTheSameOfMeanRemovedTiles) {
  const auto waves = [](const RayNodes& n) {
    return std::round(30000 + 9000 * std::sin(0.7 * n.s + 0.3 * n.u) * std::cos(0.9 * n.t + n.v));
  };
  auto plain = small_field(waves, 1, 5, 16);
  crop_stored(*plain, {4, 8}, {6, 6});
  const auto with_means = mean_removed(*plain, 32);
  ASSERT_TRUE(problems(*with_means).empty());
  EXPECT_EQ(decoded_bytes(*with_means), decoded_bytes(*plain));
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    const auto expected = decode_field(plain).slabs[0].samples;
    const auto found = decode_field(with_means).slabs[0].samples;
    EXPECT_TRUE(std::ranges::equal(found.view(), expected.view())) << to_string(width);
  }
  force_vector_width({});
  for (int u = 0; u < 5; ++u)
    for (int s = 0; s < 16; ++s)
      for (int t = 0; t < 16; ++t)
        ASSERT_EQ(with_means->node_value(0, {u, 4 - u, s, t}),
                  plain->node_value(0, {u, 4 - u, s, t}));
}

TEST(FieldLevel, CoarseNodesLieMidwayBetweenFineNodes) {
  const auto field = small_field(noise, 1, 5, 12);
  const auto pyramid = make_field_pyramid(field, 2);
  const GridAxis& fine = field->light_slab.slabs[0].s;
  const GridAxis& half = pyramid[0]->slabs[0].geometry.s;
  const GridAxis& quarter = pyramid[1]->slabs[0].geometry.s;
  constexpr double kRounding = 1e-9;  // of double arithmetic on hundreds of mm
  for (int i = 0; i < half.nodes; ++i)
    EXPECT_NEAR(half.position_mm(i), fine.first_mm + (2 * i + 0.5) * fine.spacing_mm(), kRounding);
  for (int i = 0; i < quarter.nodes; ++i)
    EXPECT_NEAR(
        quarter.position_mm(i), fine.first_mm + (4 * i + 1.5) * fine.spacing_mm(), kRounding);
}

TEST(FieldLevel, BlurSigmaIsThatOfAnImpulse) {
  // The response of level 2 to one node of level 0, over all positions of that node: its variance.
  const auto spread = [](int at) {
    const auto field =
        small_field([&](const RayNodes& n) { return n.s == at ? 65535 : 0; }, 1, 3, 32);
    const FieldLevel level = *make_field_pyramid(field, 2)[1];
    std::array<double, 3> moments{};
    for (int s = 0; s < 8; ++s) {
      const double x = 4.0 * s + 1.5 - at;
      const double value = sample(level, {0, 0, s, 4});
      for (std::size_t m = 0; m < 3; ++m) moments[m] += value * std::pow(x, m);
    }
    return moments;
  };
  std::array<double, 3> sums{};
  for (int at = 14; at < 18; ++at)
    for (std::size_t m = 0; m < 3; ++m) sums[m] += spread(at)[m];
  const double variance = sums[2] / sums[0] - std::pow(sums[1] / sums[0], 2);
  const FieldLevel level = *make_field_pyramid(small_field(noise, 1, 3, 32), 2)[1];
  // Samples are rounded twice to integers of 65535.
  EXPECT_NEAR(std::sqrt(variance), level_blur_sigma_in_nodes(2), 1e-3);
  const GridAxis& s = level.field_geometry.slabs[0].s;
  const GridAxis& t = level.field_geometry.slabs[0].t;
  EXPECT_NEAR(level.blur_sigma_mm(),
              std::sqrt(variance) * 0.5 * (s.spacing_mm() + t.spacing_mm()),
              1e-3 * level.blur_sigma_mm());
  EXPECT_GT(level.blur_sigma_mm(true), level.blur_sigma_mm());
}

/// A field's geometry of two slabs of `nodes` x `nodes` over `side_mm` at the plane through the
/// centre.
LightSlab square_slabs(int nodes, double side_mm) {
  LightSlab light_slab;
  light_slab.uv_plane_y_mm = 2600.0;
  for (const double y_mm : {-50.0, 50.0}) {
    SlabGeometry slab;
    slab.st_plane_y_mm = y_mm;
    const double half_mm =
        0.5 * side_mm * (light_slab.uv_plane_y_mm - y_mm) / light_slab.uv_plane_y_mm;
    slab.s = slab.t = {-half_mm, half_mm, nodes};
    light_slab.slabs.push_back(slab);
  }
  return light_slab;
}

TEST(FieldLevel, BeginsWithMoreHalvingsOfFinerNodesNotOfAWiderRange) {
  // 10 degrees and 30 mm: 281 mm; 20 degrees and 40 mm: 410 mm.
  EXPECT_NEAR(node_spacing_mm(square_slabs(256, 281.0)), 281.0 / 255.0, 1e-9);
  EXPECT_EQ(halvings_to_usual_nodes(square_slabs(256, 281.0)), 0);
  EXPECT_EQ(halvings_to_usual_nodes(square_slabs(384, 281.0)), 1);
  EXPECT_EQ(halvings_to_usual_nodes(square_slabs(384, 410.0)), 0);
  EXPECT_EQ(halvings_to_usual_nodes(square_slabs(768, 410.0)), 1);
  // Small objects, whose nodes stand close, do not begin with more halvings either.
  EXPECT_EQ(halvings_to_usual_nodes(square_slabs(256, 60.0)), 0);
}

TEST(FieldLevel, SamplesDoNotDependOnVectorWidth) {
  const auto field = cropped_noise(16, {4, 8}, {2, 12});
  const auto expected = make_field_pyramid(field, 2);
  for (const auto& level : expected) std::ignore = level->slabs[0].samples.view();
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    const auto pyramid = make_field_pyramid(field, 2);
    for (std::size_t level = 0; level < 2; ++level)
      EXPECT_TRUE(std::ranges::equal(pyramid[level]->slabs[0].samples.view(),
                                     expected[level]->slabs[0].samples.view()));
  }
  force_vector_width(std::nullopt);
}

/// The field has odd numbers of nodes and slabs, so that levels both halve and merge. Viewpoints of
/// the coarsest level, asked for one by one and backwards, must make what they need.
TEST(FieldLevel, SamplesDoNotDependOnWhatIsLookedAtFirst) {
  const auto plain = small_field(noise, 3, 5, 16);
  auto with_filter = std::make_shared<CompressedAttenuationField>(*plain);
  with_filter->codebook.filter.emplace().weights[0][1] = 0.25f;
  for (const auto& field : {plain, with_filter}) {
    const auto whole = make_field_pyramid(field, 2)[1];
    const auto level = make_field_pyramid(field, 2)[1];
    ASSERT_EQ(level->slabs.size(), 2u);
    for (std::size_t k = 0; k < 2; ++k) {
      const std::size_t count = level->slabs[k].samples_per_viewpoint();
      const auto expected = whole->slabs[k].samples.view();
      for (int viewpoint = 24; viewpoint >= 0; --viewpoint)
        EXPECT_TRUE(std::ranges::equal(
            std::span(level->slabs[k].samples.viewpoints(viewpoint / 5, viewpoint % 5), count),
            expected.subspan(static_cast<std::size_t>(viewpoint) * count, count)));
    }
  }
}

TEST(FieldLevel, RefusesAxesThatCannotBeHalved) {
  EXPECT_THROW(decode_halved_field(small_field(noise, 1, 3, 2)), InputError);
}

/// Linear along s and t: blurring and decimation leave it as it is, away from the lattice's edges.
double linear(const RayNodes& n) {
  return 4096 + 16 * (3 * n.u + 5 * n.v + 8 * n.s - 4 * n.t);
}

TEST(TwoPassAfDrr, LevelsOfALinearFieldGiveTheSameDrr) {
  for (const int slabs : {1, 3}) {
    // Merging and summing reach further, so the lattice's edges must be further away.
    const auto field = small_field(linear, slabs, 5, slabs == 1 ? 32 : 64);
    const View whole = View::whole_detector(small_camera());
    const View view{whole.camera,
                    slabs == 1 ? RegionOfInterest{8, 6, 15, 12} : RegionOfInterest{12, 9, 7, 6}};
    const TwoPassAfDrr fine(field);
    const TwoPassAfDrr decoded(std::make_shared<const FieldLevel>(decode_field(field)));
    const auto pyramid = make_field_pyramid(field, 2);
    for (std::uint64_t i = 0; i < 5; ++i) {
      const RigidTransform pose = pose_from_parameters({}, small_pose(i));
      const Image2d expected = render_image(fine, pose, view);
      // Single-precision node coordinates: 32 nodes * 1e-7 of slopes below the values themselves.
      constexpr float kTolerance = 1e-5f;
      // Each merging rounds its samples to whole levels of 0.25.
      const float rounding = slabs > 1 ? 2 * 0.125f : 0.0f;
      for (const auto& pixels : {render_image(decoded, pose, view).pixels,
                                 render_image(TwoPassAfDrr(pyramid[0]), pose, view).pixels,
                                 render_image(TwoPassAfDrr(pyramid[1]), pose, view).pixels})
        for (std::size_t p = 0; p < pixels.size(); ++p)
          EXPECT_NEAR(pixels[p], expected.pixels[p], rounding + kTolerance * expected.pixels[p]);
    }
  }
}

TEST(TwoPassAfDrr, LevelsHaveTheCoverageOfTheField) {
  const auto field = small_field(linear, 2, 5, 32);
  const View view = View::whole_detector(small_camera());
  const RigidTransform pose = pose_partly_outside();
  std::int64_t expected = 0;
  render_image(TwoPassAfDrr(field), pose, view, &expected);
  EXPECT_GT(expected, 0);
  for (const auto& level : make_field_pyramid(field, 2)) {
    std::int64_t outside = 0;
    render_image(TwoPassAfDrr(level), pose, view, &outside);
    EXPECT_EQ(outside, expected);
  }
}

TEST(View, CoarsePixelLiesAtTheMeanOfItsFinePixels) {
  const View fine{small_camera(), {3, 5, 22, 17}};
  const View coarse = fine.coarser(4);
  EXPECT_EQ(coarse.roi.width, 5);
  EXPECT_EQ(coarse.roi.height, 4);
  for (int row = 0; row < coarse.roi.height; ++row)
    for (int column = 0; column < coarse.roi.width; ++column) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (int i = 0; i < 16; ++i)
        mean += fine.camera.detector_point(fine.roi.column + 4 * column + i % 4,
                                           fine.roi.row + 4 * row + i / 4) /
                16.0;
      EXPECT_NEAR((coarse.camera.detector_point(column, row) - mean).norm(), 0.0, 1e-9);
    }
}

}  // namespace
}  // namespace af
