// SPDX-License-Identifier: Apache-2.0
#include "drr/filtered_decoding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "base/vector_width.h"
#include "drr/field_level.h"
#include "drr/field_renderer.h"
#include "drr/two_pass_af_drr.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

using FieldPointer = std::shared_ptr<const CompressedAttenuationField>;

/// Weights small enough that few levels are limited.
TileFilter any_filter() {
  HashRandom random(7);
  TileFilter filter;
  for (auto& of_coefficient : filter.weights)
    for (float& weight : of_coefficient) weight = static_cast<float>(random.uniform(-0.03, 0.03));
  return filter;
}

/// Integer noise, alike everywhere; some tiles are empty.
double holed_noise(const RayNodes& n) {
  const auto tile_number = [](double node) { return static_cast<int>(node) / 2; };
  if ((tile_number(n.s) + 2 * tile_number(n.t) + tile_number(n.u)) % 5 == 0) return 0.0;
  const auto index = static_cast<std::uint64_t>(((n.u * 100 + n.v) * 100 + n.s) * 100 + n.t);
  return std::floor(HashRandom(9, index).uniform(20000, 40000));
}

std::shared_ptr<CompressedAttenuationField> filtered(
    std::shared_ptr<CompressedAttenuationField> field, const TileFilter& filter) {
  field->codebook.filter = filter;
  return field;
}

/// Fields plain and mean-removed, cropped and whole, with odd and even numbers of nodes. Their rows
/// of tiles are shorter or longer than a vector. Numbers along u and v differ, down to one tile
/// along either.
std::vector<std::shared_ptr<CompressedAttenuationField>> fields() {
  auto cropped = small_field(holed_noise, 1, 4, 13);
  crop_stored(*cropped, {2, 8}, {4, 9});
  const auto wide = small_field(holed_noise, 1, 3, 37);
  const auto low = small_field(holed_noise, 1, 8, 11);
  crop_viewpoints(*low, 8, 2);
  const auto narrow = small_field(holed_noise, 1, 7, 11);
  crop_viewpoints(*narrow, 2, 7);
  return {filtered(small_field(holed_noise, 2), any_filter()),
          filtered(cropped, any_filter()),
          filtered(mean_removed(*wide, 64), any_filter()),
          filtered(wide, any_filter()),
          filtered(low, any_filter()),
          filtered(narrow, any_filter()),
          // Five rows of viewpoint tiles, and one.
          filtered(small_field(holed_noise, 1, 10, 7), any_filter()),
          filtered(small_field(holed_noise, 1, 2, 15), any_filter())};
}

/// Calls visit(slab, node, sample) for every stored node.
template <typename Visit>
void for_each_node(const FieldLevel& level, Visit&& visit) {
  for (std::size_t k = 0; k < level.slabs.size(); ++k) {
    const SlabGeometry& slab = level.slabs[k].geometry;
    std::size_t next = 0;
    for (int u = 0; u < level.field_geometry.u.nodes; ++u)
      for (int v = 0; v < level.field_geometry.v.nodes; ++v)
        for (int t = slab.stored_t.begin; t < slab.stored_t.end(); ++t)
          for (int s = slab.stored_s.begin; s < slab.stored_s.end(); ++s)
            visit(k, NodeIndex{u, v, s, t}, level.slabs[k].samples.view()[next++]);
  }
}

TEST(FilteredDecoding, EqualsTheDefinition) {
  for (const auto& field : fields()) {
    std::size_t empty = 0;
    std::size_t changed = 0;
    std::size_t all = 0;
    std::size_t rounded_otherwise = 0;
    auto unfiltered = *field;
    unfiltered.codebook.filter.reset();
    for_each_node(decode_field(field), [&](std::size_t k, const NodeIndex& node, int sample) {
      const double defined = static_cast<double>(field->node_value(k, node)) / 0.25;
      // The definition sums in double precision, so that a half may be rounded the other way.
      ASSERT_NEAR(sample, defined, 1.0) << k << ' ' << node.u << ' ' << node.v;
      ++all;
      if (sample != static_cast<int>(defined)) ++rounded_otherwise;
      const double before = static_cast<double>(unfiltered.node_value(k, node)) / 0.25;
      if (before == 0.0 && sample == 0) ++empty;
      if (std::abs(before - sample) > 1.0) ++changed;
    });
    EXPECT_GT(empty, all / 10);
    EXPECT_GT(changed, all / 2);
    EXPECT_LT(rounded_otherwise, all / 100);
  }
}

TEST(FilteredDecoding, HasTheSameBitsOnEveryVectorWidth) {
  for (const auto& field : fields()) {
    const FieldLevel whole = decode_field(field);
    for (const FieldLevelSlab& slab : whole.slabs) std::ignore = slab.samples.view();
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      const FieldLevel level = decode_field(field);
      for (std::size_t k = 0; k < level.slabs.size(); ++k)
        EXPECT_TRUE(
            std::ranges::equal(level.slabs[k].samples.view(), whole.slabs[k].samples.view()));
    }
    force_vector_width(std::nullopt);
  }
}

/// A hostile file may hold such weights. The result may be anything, but must not trap and must not
/// depend on the vector width.
TEST(FilteredDecoding, TakesTheLargestWeights) {
  TileFilter filter = any_filter();
  HashRandom random(8);
  for (auto& of_coefficient : filter.weights)
    for (float& weight : of_coefficient)
      weight = random.uniform() < 0.5 ? -kLargestFilterWeight : kLargestFilterWeight;
  EXPECT_TRUE(problems(filter).empty());
  const auto field = filtered(small_field(holed_noise, 1), filter);
  const FieldLevel whole = decode_field(field);
  const auto expected = whole.slabs[0].samples.view();
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    const FieldLevel level = decode_field(field);
    EXPECT_TRUE(std::ranges::equal(level.slabs[0].samples.view(), expected));
  }
  force_vector_width(std::nullopt);
  filter.weights[2][3] = 1.01e6f;
  EXPECT_EQ(problems(filter).size(), 1u);
}

TEST(FilteredDecoding, LeavesWhatIsConstantAsItIs) {
  TileFilter filter = any_filter();
  // A constant has no differences. Its sums are not 0, so the tile's own weight must cancel them.
  float own = 0.0f;
  for (std::size_t a = 0; a < 4; ++a) {
    own -= 2.0f * filter.weights[0][axis_input(a)];
    for (std::size_t b = a + 1; b < 4; ++b) own -= 4.0f * filter.weights[0][pair_input(a, b)];
  }
  filter.weights[0][0] = own;
  const auto field = filtered(small_field([](const RayNodes&) { return 23456.0; }, 1), filter);
  const SlabGeometry& slab = field->light_slab.slabs[0];
  for_each_node(decode_field(field), [&](std::size_t, const NodeIndex& node, int sample) {
    const bool is_inner =
        node.s >= 2 && node.t >= 2 && node.s < slab.s.nodes - 3 && node.t < slab.t.nodes - 3;
    if (is_inner) {
      EXPECT_EQ(sample, 23456);
    }
  });
}

/// A filter treats both directions of every axis alike.
TEST(FilteredDecoding, MirrorsWithTheField) {
  constexpr int kUv = 4;
  constexpr int kSt = 8;
  const auto mirrored = [](std::size_t axis) {
    return [axis](RayNodes n) {
      if (axis == 0) n.u = kUv - 1 - n.u;
      if (axis == 1) n.v = kUv - 1 - n.v;
      if (axis == 2) n.s = kSt - 1 - n.s;
      if (axis == 3) n.t = kSt - 1 - n.t;
      return n;
    };
  };
  const auto noise = [](const RayNodes& n) {
    const auto index = static_cast<std::uint64_t>(((n.u * 100 + n.v) * 100 + n.s) * 100 + n.t);
    return std::floor(HashRandom(3, index).uniform(20000, 40000));
  };
  const auto field = filtered(small_field(noise, 1, kUv, kSt), any_filter());
  for (std::size_t axis = 0; axis < 4; ++axis) {
    const auto mirror = mirrored(axis);
    const auto other =
        filtered(small_field([&](const RayNodes& n) { return noise(mirror(n)); }, 1, kUv, kSt),
                 any_filter());
    for_each_node(decode_field(other), [&](std::size_t, const NodeIndex& node, int sample) {
      const RayNodes at = mirror({static_cast<double>(node.u),
                                  static_cast<double>(node.v),
                                  static_cast<double>(node.s),
                                  static_cast<double>(node.t)});
      const NodeIndex there{static_cast<int>(at.u),
                            static_cast<int>(at.v),
                            static_cast<int>(at.s),
                            static_cast<int>(at.t)};
      ASSERT_NEAR(sample, static_cast<double>(field->node_value(0, there)) / 0.25, 1.0)
          << "axis " << axis;
    });
  }
}

TEST(FilteredDecoding, IsWhatEveryWayOfLookingUpSees) {
  const auto field = filtered(mean_removed(*small_field(waves, 2, 4, 12), 64), any_filter());
  auto unfiltered = std::make_shared<CompressedAttenuationField>(*field);
  unfiltered->codebook.filter.reset();
  const View view = View::whole_detector(small_camera());
  const RigidTransform pose = pose_from_parameters({}, small_pose(1));
  const auto decoded = std::make_shared<const FieldLevel>(decode_field(field));
  const Image2d by_level = render_image(TwoPassAfDrr(decoded), pose, view);
  const Image2d by_field = render_image(TwoPassAfDrr(FieldPointer(field)), pose, view);
  EXPECT_EQ(by_field.pixels, by_level.pixels);
  const Image2d literal = render_image(*make_field_renderer(field, "quadrilinear"), pose, view);
  const Image2d without =
      render_image(*make_field_renderer(FieldPointer(unfiltered), "quadrilinear"), pose, view);
  // Two passes only approximate the literal sum, which these weights make rough.
  double largest_change = 0.0;
  double largest_difference = 0.0;
  const auto raise_to = [](double& largest, float a, float b) {
    largest = std::max(largest, std::abs(static_cast<double>(a) - static_cast<double>(b)));
  };
  for (std::size_t i = 0; i < literal.pixels.size(); ++i) {
    raise_to(largest_change, literal.pixels[i], without.pixels[i]);
    raise_to(largest_difference, literal.pixels[i], by_level.pixels[i]);
  }
  EXPECT_GT(largest_change, 100.0);
  EXPECT_LT(largest_difference, 0.1 * largest_change);
}

/// With one slab, a pyramid begins at level 1. Without a filter, it never makes level 0.
TEST(FilteredDecoding, IsWhatPyramidsAreMadeOf) {
  const auto field = filtered(small_field(waves, 1, 4, 12), any_filter());
  const FieldLevels from_field = make_field_pyramid(field, 2);
  const FieldLevels from_samples =
      make_field_pyramid(std::make_shared<const FieldLevel>(decode_field(field)), 2);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_TRUE(std::ranges::equal(from_field[i]->slabs[0].samples.view(),
                                   from_samples[i]->slabs[0].samples.view()));
}

}  // namespace
}  // namespace af
