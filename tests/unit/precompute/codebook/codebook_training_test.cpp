// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/codebook_training.h"

#include <algorithm>
#include <barrier>
#include <cmath>
#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/vector_width.h"
#include "precompute/casting/unit_planner.h"
#include "precompute/codebook/mean_removal.h"
#include "precompute/codebook/nearest_codeword.h"
#include "precompute/codebook/tile_drawing.h"
#include "unit/precompute/codebook/selected_tiles.h"

namespace af {
namespace {

constexpr std::uint64_t kSeed = 11;

std::vector<NumberedTile> training_tiles(std::size_t count) {
  std::vector<NumberedTile> tiles(count);
  for (std::size_t i = 0; i < count; ++i) {
    HashRandom random(kSeed, 1, i);
    const double level = 1.0 + 30000.0 * random.uniform() * random.uniform();
    const double slope = 0.1 * level * random.normal();
    tiles[i].global_index = static_cast<std::int64_t>(7 * i);
    for (unsigned element = 0; element < 16; ++element)
      tiles[i].tile[element] = static_cast<std::uint16_t>(std::clamp(
          level + ((element & 1u) != 0 ? slope : 0.0) + 50.0 * random.normal(), 1.0, 65535.0));
  }
  return tiles;
}

/// The tiles dealt out to `ranks` shares; every ninth is held out.
std::vector<TrainingShare> dealt(const std::vector<NumberedTile>& tiles, std::size_t ranks) {
  std::vector<TrainingShare> shares(ranks);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    TrainingShare& share = shares[(i * i + i / 3) % ranks];
    (i % 9 == 8 ? share.held_out : share.training).push_back(tiles[i]);
  }
  return shares;
}

/// Threads that reduce like ranks.
class ThreadRanks {
 public:
  explicit ThreadRanks(std::size_t ranks)
      : barrier_(static_cast<std::ptrdiff_t>(ranks)), sums_(ranks), bytes_(ranks) {}

  CodebookReduction reduction_of(std::size_t rank) {
    return {[this, rank](std::span<std::uint64_t> values) {
              sums_[rank].assign(values.begin(), values.end());
              barrier_.arrive_and_wait();
              std::fill(values.begin(), values.end(), 0);
              for (const auto& of_rank : sums_)
                for (std::size_t i = 0; i < values.size(); ++i) values[i] += of_rank[i];
              barrier_.arrive_and_wait();
            },
            [this, rank](std::span<const std::byte> mine) {
              bytes_[rank].assign(mine.begin(), mine.end());
              barrier_.arrive_and_wait();
              auto all = bytes_;
              barrier_.arrive_and_wait();
              return all;
            },
            rank};
  }

 private:
  std::barrier<> barrier_;
  std::vector<std::vector<std::uint64_t>> sums_;
  std::vector<std::vector<std::byte>> bytes_;
};

TrainedCodebook train_on_threads(const std::vector<TrainingShare>& shares,
                                 const CodebookOptions& options) {
  ThreadRanks ranks(shares.size());
  std::vector<TrainedCodebook> results(shares.size());
  std::vector<std::thread> threads;
  for (std::size_t rank = 0; rank < shares.size(); ++rank)
    threads.emplace_back([&, rank] {
      results[rank] = train_codebook(shares[rank], options, ranks.reduction_of(rank));
    });
  for (std::thread& thread : threads) thread.join();
  for (const TrainedCodebook& result : results)
    EXPECT_EQ(result.codebook.codewords, results.front().codebook.codewords);
  return results.front();
}

TrainedCodebook train_serially(const TrainingShare& share, const CodebookOptions& options) {
  return train_codebook(share, options, serial_reduction());
}

TEST(CodebookTraining, IsBitIdenticalOnAnyRankCount) {
  const auto tiles = training_tiles(4000);
  const CodebookOptions options{.codewords = 200, .seed = kSeed};
  const TrainedCodebook expected = train_serially(dealt(tiles, 1).front(), options);
  for (const std::size_t ranks : {2u, 3u, 4u}) {
    const TrainedCodebook trained = train_on_threads(dealt(tiles, ranks), options);
    EXPECT_EQ(trained.codebook.codewords, expected.codebook.codewords);
    ASSERT_EQ(trained.iterations.size(), expected.iterations.size());
    for (std::size_t i = 0; i < expected.iterations.size(); ++i) {
      EXPECT_EQ(trained.iterations[i].training_squared_error,
                expected.iterations[i].training_squared_error);
      EXPECT_EQ(trained.iterations[i].held_out_squared_error,
                expected.iterations[i].held_out_squared_error);
      EXPECT_EQ(trained.iterations[i].codewords_repaired,
                expected.iterations[i].codewords_repaired);
    }
  }
}

void expect_goes_on_from_any_iteration(int mean_step) {
  TrainingShare share = dealt(training_tiles(3000), 1).front();
  remove_means(share, mean_step);
  const CodebookOptions options{
      .codewords = 100, .max_iterations = 20, .seed = kSeed, .mean_step = mean_step};
  std::vector<TrainedCodebook> after_iterations;
  TrainingCheckpoints remember;
  remember.on_iteration = [&](const TrainedCodebook& so_far) {
    after_iterations.push_back(so_far);
  };
  const TrainedCodebook whole = train_codebook(share, options, serial_reduction(), {}, remember);
  ASSERT_GT(whole.iterations.size(), 2u);
  ASSERT_EQ(after_iterations.size(), whole.iterations.size());
  for (const TrainedCodebook& begun : after_iterations) {
    std::size_t iterations_done = 0;
    TrainingCheckpoints go_on;
    go_on.begun = begun;
    go_on.on_iteration = [&](const TrainedCodebook&) { ++iterations_done; };
    const TrainedCodebook trained = train_codebook(share, options, serial_reduction(), {}, go_on);
    EXPECT_EQ(trained.codebook.codewords, whole.codebook.codewords);
    EXPECT_EQ(trained.codebook.mean_step, mean_step);
    EXPECT_EQ(trained.stop, whole.stop);
    EXPECT_EQ(iterations_done, whole.iterations.size() - begun.iterations.size());
  }
}

TEST(CodebookTraining, GoesOnFromAnyIterationToTheSameCodebook) {
  expect_goes_on_from_any_iteration(0);
}

TEST(CodebookTraining, OfShapesGoesOnFromAnyIterationToTheSameCodebook) {
  expect_goes_on_from_any_iteration(64);
}

TEST(CodebookTraining, IsBitIdenticalOnEveryVectorWidth) {
  const TrainingShare share = dealt(training_tiles(3000), 1).front();
  const CodebookOptions options{.codewords = 100, .seed = kSeed};
  const TrainedCodebook expected = train_serially(share, options);
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    EXPECT_EQ(train_serially(share, options).codebook.codewords, expected.codebook.codewords);
  }
  force_vector_width(std::nullopt);
}

TEST(CodebookTraining, ARankWithoutTilesTakesPart) {
  auto shares = dealt(training_tiles(1000), 1);
  shares.emplace_back();
  const CodebookOptions options{.codewords = 50, .seed = kSeed};
  const TrainedCodebook with_empty_rank = train_on_threads(shares, options);
  EXPECT_EQ(with_empty_rank.codebook.codewords,
            train_serially(shares.front(), options).codebook.codewords);
}

TEST(CodebookTraining, GivesASortedCodebookOfDistinctCodewordsWithTheZeroTileFirst) {
  const TrainedCodebook trained =
      train_serially(dealt(training_tiles(3000), 1).front(), {.codewords = 500, .seed = kSeed});
  const auto& codewords = trained.codebook.codewords;
  ASSERT_EQ(codewords.size(), 500u);
  EXPECT_TRUE(problems(trained.codebook).empty());
  EXPECT_EQ(std::set<Tile>(codewords.begin(), codewords.end()).size(), codewords.size());
}

TEST(CodebookTraining, IterationsNeverRaiseTheTrainingErrorMoreThanRoundingAndRepairCan) {
  const TrainingShare share = dealt(training_tiles(5000), 1).front();
  const TrainedCodebook trained = train_serially(
      share,
      {.codewords = 100, .max_iterations = 30, .min_relative_improvement = 0.0, .seed = kSeed});
  ASSERT_GE(trained.iterations.size(), 3u);
  for (std::size_t i = 1; i < trained.iterations.size(); ++i) {
    // Rounding a centroid moves each of 16 elements by at most half a level.
    const std::uint64_t rounding = share.training.size() * 16 / 4;
    EXPECT_LE(trained.iterations[i].training_squared_error,
              trained.iterations[i - 1].training_squared_error + rounding);
  }
  EXPECT_EQ(trained.training_tiles, share.training.size());
  EXPECT_EQ(trained.held_out_tiles, share.held_out.size());
}

TEST(CodebookTraining, CodewordsEndAsTheRoundedMeansOfTheTilesNearestToThem) {
  const TrainingShare share = dealt(training_tiles(800), 1).front();
  const TrainedCodebook trained = train_serially(
      share,
      {.codewords = 12, .max_iterations = 500, .min_relative_improvement = 0.0, .seed = kSeed});
  ASSERT_EQ(trained.stop, TrainingStop::ImprovementBelowLimit);
  std::vector<Tile> tiles;
  for (const NumberedTile& tile : share.training) tiles.push_back(tile.tile);
  std::vector<std::uint32_t> nearest(tiles.size());
  std::vector<std::uint64_t> errors(tiles.size());
  NearestCodeword(trained.codebook).search(tiles, SearchHint::None, nearest, errors);
  for (std::uint32_t codeword = 1; codeword < 12; ++codeword)
    for (std::size_t element = 0; element < 16; ++element) {
      double sum = 0.0;
      double count = 0.0;
      for (std::size_t i = 0; i < tiles.size(); ++i) {
        if (nearest[i] != codeword) continue;
        sum += tiles[i][element];
        count += 1.0;
      }
      ASSERT_GT(count, 0.0);
      EXPECT_NEAR(trained.codebook.codewords[codeword][element], sum / count, 0.5 + 1e-9);
    }
}

TEST(CodebookTraining, RefusesMoreCodewordsThanDistinctTiles) {
  TrainingShare share = dealt(training_tiles(40), 1).front();
  const std::size_t distinct = share.training.size();
  for (int copy = 0; copy < 100; ++copy) {
    share.training.push_back(share.training.front());
    share.training.back().global_index = 100000 + copy;
  }
  const int fitting = static_cast<int>(distinct) + 1;
  EXPECT_NO_THROW(train_serially(share, {.codewords = fitting, .seed = kSeed}));
  EXPECT_THROW(train_serially(share, {.codewords = fitting + 1, .seed = kSeed}), InputError);
}

TEST(CodebookTraining, KeepsTheSizeWhenTilesRunOut) {
  // There are as many codewords as tiles. So every tile becomes a codeword, and none is left for
  // repairs.
  const TrainingShare share = dealt(training_tiles(40), 1).front();
  const int codewords = static_cast<int>(share.training.size()) + 1;
  const TrainedCodebook trained = train_serially(share, {.codewords = codewords, .seed = kSeed});
  EXPECT_EQ(trained.codebook.size(), static_cast<std::size_t>(codewords));
  EXPECT_EQ(trained.iterations.back().training_squared_error, 0u);
}

TEST(CodebookOptions, ProblemsNameEveryBrokenConstraint) {
  EXPECT_EQ(problems(CodebookOptions{.codewords = 1, .max_iterations = 0}).size(), 2u);
  EXPECT_EQ(problems(CodebookOptions{.codewords = 65537}).size(), 1u);
  EXPECT_TRUE(problems(CodebookOptions{}).empty());
}

TEST(TileSelection, SmallestKeysEqualASerialSort) {
  const auto tiles = training_tiles(500);
  std::vector<std::uint64_t> keys;
  for (std::size_t i = 0; i < tiles.size(); ++i) keys.push_back(hash64(kSeed, i) >> (i % 2 * 56));
  std::vector<std::pair<std::uint64_t, std::int64_t>> expected;
  for (std::size_t i = 0; i < tiles.size(); ++i)
    expected.emplace_back(keys[i], tiles[i].global_index);
  std::sort(expected.begin(), expected.end());
  for (const std::size_t count : {1u, 3u, 250u, 499u, 500u, 600u}) {
    const auto picked = smallest_keyed_tiles(keys, tiles, count, serial_reduction());
    ASSERT_EQ(picked.size(), std::min<std::size_t>(count, 500));
    for (std::size_t i = 0; i < picked.size(); ++i) {
      EXPECT_EQ(picked[i].key, expected[i].first);
      EXPECT_EQ(picked[i].numbered.global_index, expected[i].second);
    }
  }
}

TEST(TileSelection, StrongTilesAreDrawnInProportionToTheirWeight) {
  // Two kinds whose AC norms are 1 : 16, so the weights are 1 : 4. The smallest keys of equal
  // numbers of both kinds then hold 4 strong ones in 5.
  std::vector<std::pair<std::uint64_t, bool>> keys;
  constexpr int kOfKind = 20000;
  for (int i = 0; i < 2 * kOfKind; ++i) {
    NumberedTile tile{i, {}};
    tile.tile.fill(1000);
    tile.tile[3] = static_cast<std::uint16_t>(1000 + (i % 2 == 0 ? 10 : 160));
    keys.emplace_back(weighted_sampling_key(kSeed, tile), i % 2 != 0);
  }
  std::sort(keys.begin(), keys.end());
  constexpr int kDrawn = 1000;
  const auto strong = std::count_if(
      keys.begin(), keys.begin() + kDrawn, [](const auto& key) { return key.second; });
  // Binomial standard deviation sqrt(1000 * 0.8 * 0.2) = 12.6; five of them, and 1 % for the
  // tiles already drawn.
  EXPECT_NEAR(static_cast<double>(strong), 0.8 * kDrawn, 5 * 12.6 + 10.0);
}

struct CastField {
  FieldLattice lattice{{{{16, {0, 16}}, {16, {0, 16}}, {64, {0, 64}}, {64, {0, 64}}}}};
  std::vector<WorkUnit> units;
  std::vector<UnitTiles> tiles;
  std::uint64_t occupied = 0;
};

/// Samples that are empty on a third of the (s,t) plane.
CastField cast_field(std::int64_t rays_per_unit) {
  CastField field;
  field.units = plan_units(field.lattice, {rays_per_unit});
  for (const WorkUnit& unit : field.units) {
    std::vector<std::uint16_t> samples;
    for (int u = unit.u.begin; u < unit.u.end(); ++u)
      for (int v = unit.v.begin; v < unit.v.end(); ++v)
        for (int s = unit.s.begin; s < unit.s.end(); ++s)
          for (int t = unit.t.begin; t < unit.t.end(); ++t)
            samples.push_back(static_cast<std::uint16_t>(s < 22 ? 0 : 1 + 64 * u + 16 * v + s + t));
    field.tiles.push_back(make_unit_tiles(unit, samples));
    field.occupied += field.tiles.back().tiles.size();
  }
  return field;
}

std::set<std::int64_t> indices_of(const std::vector<NumberedTile>& tiles) {
  std::set<std::int64_t> indices;
  for (const NumberedTile& tile : tiles) indices.insert(tile.global_index);
  return indices;
}

TEST(TileSelection, DependsOnlyOnSeedAndTileNumber) {
  const CastField coarse = cast_field(1000000);
  const CastField fine = cast_field(3000);
  const auto select = [](const CastField& field, std::uint64_t seed) {
    return test::select_training_tiles(
        field.tiles, field.units, field.lattice, {0.2, 1000000, seed});
  };
  const TrainingShare share = select(coarse, 1);
  EXPECT_EQ(indices_of(share.training), indices_of(select(fine, 1).training));
  EXPECT_EQ(indices_of(share.held_out), indices_of(select(fine, 1).held_out));
  EXPECT_NE(indices_of(share.training), indices_of(select(coarse, 2).training));
}

TEST(TileSelection, TakesTheFractionOfOccupiedTilesAndHoldsOutOthers) {
  const CastField field = cast_field(100000);
  const TrainingShare share =
      test::select_training_tiles(field.tiles, field.units, field.lattice, {0.2, 1000000, 1});
  const double expected = 0.2 * static_cast<double>(field.occupied);
  // Five binomial standard deviations.
  EXPECT_NEAR(static_cast<double>(share.training.size()), expected, 5 * std::sqrt(0.8 * expected));
  EXPECT_NEAR(
      static_cast<double>(share.held_out.size()), expected / 8, 5 * std::sqrt(expected / 8));
  const auto training = indices_of(share.training);
  for (const NumberedTile& tile : share.held_out)
    EXPECT_FALSE(training.contains(tile.global_index));
  for (const NumberedTile& tile : share.training) EXPECT_FALSE(is_zero(tile.tile));
}

TEST(TileSelection, TakesEveryTileAtFractionOneAndNoneIsHeldOut) {
  const CastField field = cast_field(100000);
  const TrainingShare share =
      test::select_training_tiles(field.tiles, field.units, field.lattice, {1.0, 1000000, 1});
  EXPECT_EQ(share.training.size(), field.occupied);
  EXPECT_TRUE(share.held_out.empty());
}

TEST(TileSelection, StaysWithinTheCap) {
  const CastField field = cast_field(100000);
  for (const std::uint64_t cap : {100u, 1000u, 5000u}) {
    const TrainingShare share =
        test::select_training_tiles(field.tiles, field.units, field.lattice, {1.0, cap, 1});
    EXPECT_LE(share.training.size(), cap);
    // The cut is at most one of 65536 steps short, far less than one tile here. But bins are not
    // equally full.
    EXPECT_GE(share.training.size(), cap * 9 / 10);
  }
}

}  // namespace
}  // namespace af
