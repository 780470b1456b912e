// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/tile_selection.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "base/error.h"
#include "base/hash_random.h"

namespace af {

namespace {

constexpr std::uint64_t kTrainingStream = 0x7472'6169'6E69'6E67;  // "training"

constexpr std::size_t kBins = 65536;
constexpr std::uint64_t kEverything = ~std::uint64_t{0};

/// Largest hash that still trains, for a fraction within (0, 1].
std::uint64_t last_hash_of_fraction(double fraction) {
  if (fraction >= 1.0) return kEverything;
  const auto threshold = static_cast<std::uint64_t>(std::ldexp(fraction, 64));
  return threshold == 0 ? 0 : threshold - 1;
}

std::uint64_t capped_last_hash(std::span<const std::uint64_t> histogram,
                               std::uint64_t last_hash,
                               std::uint64_t max_tiles) {
  std::uint64_t tiles = 0;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    tiles += histogram[bin];
    if (tiles > max_tiles) return bin == 0 ? 0 : (static_cast<std::uint64_t>(bin) << 48u) - 1;
  }
  return last_hash;
}

/// Hashes above this are held out when the last training hash is `last_training`.
std::uint64_t held_out_above(std::uint64_t last_training) {
  return kEverything - std::min(last_training / 8, (kEverything - last_training) / 2);
}

/// A bound that is not above held_out_above(x) for any x up to `last_training`, with a margin for
/// the rounding of its divisions.
std::uint64_t lowest_held_out(std::uint64_t last_training) {
  constexpr std::uint64_t kMostHeldOut = kEverything / 10 * 8;  // where the two halves meet
  return held_out_above(std::min(last_training, kMostHeldOut)) - 8;
}

/// How many of this rank's tiles other ranks take over, and where its own begin among all tiles
/// that are moved.
struct Move {
  std::uint64_t given = 0;
  std::uint64_t first_taken = 0;
  std::uint64_t taken = 0;
};

/// `counts[r]`: tiles of rank r. Every rank ends with the mean, and the first ones with one more.
Move move_of_rank(std::span<const std::uint64_t> counts, std::size_t rank) {
  const std::uint64_t all = std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
  Move move;
  for (std::size_t r = 0; r <= rank; ++r) {
    const std::uint64_t target = all / counts.size() + (r < all % counts.size() ? 1 : 0);
    move.first_taken += move.taken;
    move.given = counts[r] > target ? counts[r] - target : 0;
    move.taken = counts[r] < target ? target - counts[r] : 0;
  }
  return move;
}

/// Collective. Moves tiles from ranks that have more than the mean to ranks that have fewer, so
/// that all take equally long to train. Only the moved tiles travel.
void level_out(std::vector<NumberedTile>& tiles, const CodebookReduction& reduction) {
  const std::uint64_t mine = tiles.size();
  std::vector<std::uint64_t> counts;
  for (const auto& bytes : reduction.all_gather(std::as_bytes(std::span(&mine, 1)))) {
    counts.emplace_back();
    std::memcpy(&counts.back(), bytes.data(), sizeof(std::uint64_t));
  }
  const Move move = move_of_rank(counts, reduction.rank);
  const std::size_t kept = tiles.size() - move.given;
  std::uint64_t position = 0;
  std::vector<NumberedTile> taken(move.taken);
  for (const auto& bytes : reduction.all_gather(std::as_bytes(std::span(tiles).subspan(kept)))) {
    const std::uint64_t end = position + bytes.size() / sizeof(NumberedTile);
    const std::uint64_t from = std::max(position, move.first_taken);
    const std::uint64_t to = std::min(end, move.first_taken + move.taken);
    if (from < to)
      std::memcpy(&taken[from - move.first_taken],
                  bytes.data() + (from - position) * sizeof(NumberedTile),
                  (to - from) * sizeof(NumberedTile));
    position = end;
  }
  tiles.resize(kept);
  tiles.insert(tiles.end(), taken.begin(), taken.end());
}

}  // namespace

std::vector<std::string> problems(const TrainingSelection& selection) {
  std::vector<std::string> found;
  if (!(selection.fraction > 0.0 && selection.fraction <= 1.0))
    found.push_back("training_fraction = " + std::to_string(selection.fraction) +
                    ": must be above 0 and at most 1");
  if (selection.max_training_tiles < 1)
    found.emplace_back("max_training_tiles = 0: must be at least 1");
  return found;
}

TrainingTilePicker::TrainingTilePicker(const TrainingSelection& selection,
                                       const FieldLattice& lattice)
    : selection_(selection), lattice_(lattice), histogram_(kBins, 0) {
  throw_if_any(problems(selection));
  set_threshold(last_hash_of_fraction(selection.fraction));
  // Only the used part takes memory. It goes an eighth above the cap, so that dropping is rare.
  constexpr std::uint64_t kMostReserved = std::uint64_t{1} << 24;
  const std::uint64_t most = std::min(selection.max_training_tiles, kMostReserved);
  candidates_.training.reserve(most + most / 8 + 1);
}

void TrainingTilePicker::set_threshold(std::uint64_t last_training) {
  last_training_ = last_training;
  held_out_above_ = lowest_held_out(last_training);
}

void TrainingTilePicker::add(const UnitTiles& tiles, const WorkUnit& unit) {
  const TilePlaces places(lattice_, unit);
  tiles.for_each([&](std::size_t local_tile, const Tile& tile) {
    const NumberedTile numbered{places.global_index(local_tile), tile};
    const std::uint64_t hash = hash_of(numbered);
    if (hash <= last_training_) {
      ++histogram_[hash >> 48u];
      candidates_.training.push_back(numbered);
      if (candidates_.training.size() == candidates_.training.capacity()) keep_within_cap();
    } else if (hash > held_out_above_) {
      candidates_.held_out.push_back(numbered);
    }
  });
}

void TrainingTilePicker::keep_within_cap() {
  // When one rank's tiles alone exceed the cap, those of all ranks do too.
  set_threshold(capped_last_hash(histogram_, last_training_, selection_.max_training_tiles));
  drop_beyond();
}

void TrainingTilePicker::drop_beyond() {
  std::vector<NumberedTile>& held_out = candidates_.held_out;
  std::erase_if(held_out,
                [&](const NumberedTile& tile) { return hash_of(tile) <= held_out_above_; });
  std::erase_if(candidates_.training, [&](const NumberedTile& tile) {
    const std::uint64_t hash = hash_of(tile);
    if (hash > last_training_ && hash > held_out_above_) held_out.push_back(tile);
    return hash > last_training_;
  });
}

TrainingShare TrainingTilePicker::take(const CodebookReduction& reduction) {
  // Above a rank's own threshold its histogram lacks tiles, but the common threshold lies below it.
  reduction.sum(histogram_);
  last_training_ = capped_last_hash(
      histogram_, last_hash_of_fraction(selection_.fraction), selection_.max_training_tiles);
  held_out_above_ = held_out_above(last_training_);
  drop_beyond();
  for (std::vector<NumberedTile>* tiles : {&candidates_.training, &candidates_.held_out}) {
    tiles->shrink_to_fit();
    level_out(*tiles, reduction);
  }
  return std::move(candidates_);
}

std::uint64_t TrainingTilePicker::hash_of(const NumberedTile& tile) const {
  return hash64(selection_.seed, kTrainingStream, static_cast<std::uint64_t>(tile.global_index));
}

}  // namespace af
