// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/filter_fitting.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "drr/field_level.h"
#include "field/compressed_attenuation_field.h"
#include "precompute/codebook/codebook_training.h"
#include "precompute/codebook/mean_removal.h"
#include "precompute/codebook/unit_encoding.h"

namespace af {
namespace {

constexpr int kUv = 6;
constexpr int kSt = 48;

/// Waves along all axes with a little noise, air at one side.
std::uint16_t level_at(int u, int v, int s, int t) {
  if (s < 4) return 0;
  const double wave = std::sin(0.31 * s + 0.4 * u) + std::sin(0.27 * t - 0.5 * v) +
                      0.5 * std::sin(0.6 * s + 0.5 * t + 0.3 * u);
  const auto key = static_cast<std::uint64_t>(((u * kUv + v) * kSt + s) * kSt + t);
  return static_cast<std::uint16_t>(20000 + 4000 * wave + 20 * HashRandom(1, key).normal());
}

SlabLattice whole_lattice() {
  const LatticeAxis uv{kUv, {0, kUv}};
  const LatticeAxis st{kSt, {0, kSt}};
  return {uv, uv, st, st};
}

WorkUnit unit_of(const NodeRange& uv, const NodeRange& st) {
  WorkUnit unit;
  unit.u = unit.v = uv;
  unit.s = unit.t = st;
  return unit;
}

UnitTiles tiles_of(const WorkUnit& unit) {
  std::vector<std::uint16_t> samples;
  for (int u = unit.u.begin; u < unit.u.end(); ++u)
    for (int v = unit.v.begin; v < unit.v.end(); ++v)
      for (int s = unit.s.begin; s < unit.s.end(); ++s)
        for (int t = unit.t.begin; t < unit.t.end(); ++t) samples.push_back(level_at(u, v, s, t));
  return make_unit_tiles(unit, samples);
}

/// Has few codewords, so that much is lost.
Codebook coarse_codebook(int mean_step) {
  TrainingShare share;
  const UnitTiles tiles = tiles_of(unit_of({0, kUv}, {0, kSt}));
  for (std::size_t i = 0; i < tiles.tiles.size(); ++i)
    share.training.push_back({static_cast<std::int64_t>(i), tiles.tiles[i]});
  remove_means(share, mean_step);
  return train_codebook(
             share, {.codewords = 24, .seed = 5, .mean_step = mean_step}, serial_reduction())
      .codebook;
}

/// The whole lattice as a field, with the codebook's filter.
CompressedAttenuationField field_of(const Codebook& codebook) {
  const WorkUnit unit = unit_of({0, kUv}, {0, kSt});
  CompressedAttenuationField field;
  field.light_slab.u = field.light_slab.v = {-1.0, 1.0, kUv};
  SlabGeometry slab;
  slab.s = slab.t = {-1.0, 1.0, kSt};
  slab.stored_s = slab.stored_t = {0, kSt};
  field.light_slab.slabs.push_back(slab);
  field.quantizer_step = 1.0f;
  field.codebook = codebook;
  field.slabs.push_back({SharedArray<std::uint16_t>(
      encode_unit(NearestCodeword(codebook), unit, tiles_of(unit)).indices)});
  return field;
}

FittedFilter fit_of(const Codebook& codebook, const std::vector<WorkUnit>& patches) {
  FilterSums sums(codebook);
  for (const WorkUnit& patch : patches) sums.add(patch, whole_lattice(), tiles_of(patch));
  return sums.fit();
}

/// Sums over the third of the tiles that is fitted, without nodes that decode to empty.
double squared_error_of(const CompressedAttenuationField& field) {
  const FieldLevel decoded =
      decode_field(std::make_shared<const CompressedAttenuationField>(field));
  double sum = 0.0;
  std::size_t next = 0;
  for (int u = 0; u < kUv; ++u)
    for (int v = 0; v < kUv; ++v)
      for (int t = 0; t < kSt; ++t)
        for (int s = 0; s < kSt; ++s) {
          const double level = decoded.slabs[0].samples.view()[next++];
          const bool is_fitted = (u / 2 + v / 2 + s / 2 + t / 2) % 3 == 0;
          if (level > 0.0 && is_fitted) sum += std::pow(level - level_at(u, v, s, t), 2.0);
        }
  return sum;
}

/// A fit to a whole field states the errors of the decoded field, up to rounding to levels. No
/// other weights may have smaller ones.
TEST(FilterFitting, IsTheLeastSquaredErrorOfTheDecodedField) {
  for (const int mean_step : {0, 32}) {
    Codebook codebook = coarse_codebook(mean_step);
    const FittedFilter fitted = fit_of(codebook, {unit_of({0, kUv}, {0, kSt})});
    ASSERT_TRUE(fitted.filter.has_value());
    EXPECT_GT(fitted.tiles, 1000u);
    EXPECT_EQ(squared_error_of(field_of(codebook)), fitted.squared_error);
    // Rounding adds its variance, and four standard deviations of its product with the errors.
    constexpr double kVariance = 1.0 / 12.0;
    const double rounding = 16.0 * kVariance * static_cast<double>(fitted.tiles) +
                            4.0 * 2.0 * std::sqrt(kVariance * fitted.squared_error_left);
    codebook.filter = fitted.filter;
    const double least = squared_error_of(field_of(codebook));
    EXPECT_NEAR(least, fitted.squared_error_left, rounding);
    EXPECT_LT(least, 0.6 * fitted.squared_error);
    for (const auto& [j, i] : {std::pair{1, 0}, {2, 7}, {4, 3}, {8, 1}, {1, 12}, {0, 5}})
      for (const float change : {-0.05f, 0.05f}) {
        Codebook other = codebook;
        float& weight =
            other.filter->weights[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)];
        weight += change;
        // The weight of coefficient 0 for itself follows from the others.
        if (j == 0) other.filter->weights[0][0] -= 2.0f * change;
        EXPECT_GT(squared_error_of(field_of(other)), least - rounding) << j << ' ' << i;
      }
  }
}

/// Patches that overlap by a tile on each side count every tile once, so they sum to the whole.
TEST(FilterFitting, DoesNotDependOnHowAFieldIsCutIntoPatches) {
  const Codebook codebook = coarse_codebook(32);
  const FittedFilter whole = fit_of(codebook, {unit_of({0, kUv}, {0, kSt})});
  std::vector<WorkUnit> patches;
  for (const NodeRange& s : {NodeRange{0, 26}, NodeRange{22, 26}})
    for (const NodeRange& t : {NodeRange{0, 16}, NodeRange{12, 24}, NodeRange{32, 16}}) {
      patches.push_back(unit_of({0, kUv}, s));
      patches.back().t = t;
    }
  const FittedFilter cut = fit_of(codebook, patches);
  EXPECT_EQ(cut.tiles, whole.tiles);
  EXPECT_EQ(cut.filter, whole.filter);
  EXPECT_EQ(cut.squared_error, whole.squared_error);
}

/// A fit needs sixteen tiles for each weight of a coefficient: 528.
TEST(FilterFitting, FitsNothingToTooFewTiles) {
  const Codebook codebook = coarse_codebook(32);
  WorkUnit patch = unit_of({0, kUv}, {4, 20});
  // A third of 9 viewpoint tiles, 8 tiles along s that know their neighbours, and 24 along t.
  patch.t = {0, kSt};
  const FittedFilter enough = fit_of(codebook, {patch});
  EXPECT_EQ(enough.tiles, 576u);
  EXPECT_TRUE(enough.filter.has_value());
  patch.s.count = 18;
  const FittedFilter few = fit_of(codebook, {patch});
  EXPECT_EQ(few.tiles, 504u);
  EXPECT_FALSE(few.filter.has_value());
}

using PatchNodes = std::array<int, 9>;

std::vector<PatchNodes> nodes_of(const std::vector<WorkUnit>& patches) {
  std::vector<PatchNodes> nodes;
  for (const WorkUnit& patch : patches)
    nodes.push_back({static_cast<int>(patch.slab),
                     patch.u.begin,
                     patch.u.count,
                     patch.v.begin,
                     patch.v.count,
                     patch.s.begin,
                     patch.s.count,
                     patch.t.begin,
                     patch.t.count});
  return nodes;
}

TEST(FilterFitting, TakesPatchesFromWhatIsStored) {
  FieldLattice lattice;
  lattice.slabs = {{{64, {0, 64}}, {10, {0, 10}}, {400, {24, 361}}, {300, {10, 200}}},
                   {{64, {0, 64}}, {10, {0, 10}}, {12, {2, 10}}, {7, {0, 7}}}};
  std::array<std::set<int>, 4> places;
  std::set<std::size_t> slabs;
  std::uint64_t tiles = 0;
  for (const WorkUnit& patch : filter_patches(lattice, 1)) {
    slabs.insert(patch.slab);
    tiles += patch.tile_count();
    const SlabLattice& slab = lattice.slabs[patch.slab];
    const std::array<NodeRange, 4> parts = {patch.u, patch.v, patch.s, patch.t};
    for (std::size_t axis = 0; axis < 4; ++axis) {
      const NodeRange stored = slab.axes()[axis].stored;
      EXPECT_GE(parts[axis].begin, stored.begin);
      EXPECT_LE(parts[axis].end(), stored.end());
      EXPECT_GE(parts[axis].count, 1);
      EXPECT_EQ((parts[axis].begin - stored.begin) % (axis == 3 ? kRunOfT : 2), 0);
      EXPECT_TRUE(parts[axis].count % 2 == 0 || parts[axis].end() == stored.end());
      if (patch.slab == 0) places[axis].insert(parts[axis].begin);
    }
  }
  EXPECT_EQ(slabs.size(), 2u);
  EXPECT_LT(tiles / 3, 1u << 17);
  EXPECT_GT(places[0].size(), 12u);
  EXPECT_EQ(places[1].size(), 1u);
  EXPECT_GT(places[2].size(), 12u);
  EXPECT_GT(places[3].size(), 3u);
  EXPECT_EQ(nodes_of(filter_patches(lattice, 1)), nodes_of(filter_patches(lattice, 1)));
  EXPECT_NE(nodes_of(filter_patches(lattice, 1)), nodes_of(filter_patches(lattice, 2)));
}

/// Otherwise the tiles of small fields would count several times.
TEST(FilterFitting, TakesEveryPlaceOnce) {
  FieldLattice lattice;
  lattice.slabs = {{{12, {0, 12}}, {14, {0, 14}}, {16, {0, 16}}, {32, {0, 32}}}};
  const std::vector<WorkUnit> patches = filter_patches(lattice, 1);
  ASSERT_EQ(patches.size(), 2u);  // along v
  EXPECT_NE(patches[0].v.begin, patches[1].v.begin);
  EXPECT_EQ(patches[1].id, 1u);
}

}  // namespace
}  // namespace af
