// SPDX-License-Identifier: Apache-2.0
#include "precompute/tile_selection.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <tuple>

#include "base/error.h"
#include "base/hash_random.h"

namespace af {

namespace {

// Keys of the random streams of one seed.
constexpr std::uint64_t kTrainingStream = 0x7472'6169'6E69'6E67;  // "training"
constexpr std::uint64_t kInitialStream = 0x696E'6974'6961'6C00;   // "initial"

constexpr std::size_t kBins = 65536;
constexpr std::uint64_t kEverything = ~std::uint64_t{0};

/// Largest hash that still trains, for a fraction within (0, 1].
std::uint64_t last_hash_of_fraction(double fraction) {
  if (fraction >= 1.0) return kEverything;
  const auto threshold = static_cast<std::uint64_t>(std::ldexp(fraction, 64));
  return threshold == 0 ? 0 : threshold - 1;
}

template <typename Visit>
void for_each_numbered_tile(std::span<const UnitTiles> tiles,
                            std::span<const WorkUnit> units,
                            const LightSlab& light_slab,
                            Visit&& visit) {
  for (const UnitTiles& of_unit : tiles) {
    const WorkUnit& unit = units[of_unit.unit_id];
    const TileLattice lattice(light_slab, unit.slab);
    of_unit.for_each([&](std::size_t local_tile, const Tile& tile) {
      visit(NumberedTile{lattice.global_index(unit, light_slab, local_tile), tile});
    });
  }
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

/// Natural logarithm for (0, 1], accurate to about 1e-12: exponent and an atanh series, in
/// correctly rounded operations only (libm's last bit differs between processors).
double portable_log(double value) {
  int exponent = 0;
  double mantissa = std::frexp(value, &exponent);  // exact
  if (mantissa < 0.70710678118654752) {
    mantissa *= 2.0;
    --exponent;
  }
  const double z = (mantissa - 1.0) / (mantissa + 1.0);
  const double square = z * z;
  double series = 0.0;
  for (int denominator = 17; denominator >= 1; denominator -= 2)
    series = series * square + 1.0 / denominator;
  return 2.0 * z * series + 0.69314718055994531 * exponent;
}

/// The four summed histograms of a radix search: finds the key of the `count`-th smallest.
std::uint64_t key_of_rank(std::span<const std::uint64_t> keys,
                          std::uint64_t count,
                          const CodebookReduction& reduction) {
  std::uint64_t prefix = 0;
  std::uint64_t remaining = count;
  for (int shift = 48; shift >= 0; shift -= 16) {
    std::vector<std::uint64_t> histogram(kBins, 0);
    for (const std::uint64_t key : keys)
      if (shift == 48 || (key >> (shift + 16)) == (prefix >> (shift + 16)))
        ++histogram[(key >> shift) & 0xFFFFu];
    reduction.sum(histogram);
    std::uint64_t bin = 0;
    while (bin + 1 < kBins && histogram[bin] < remaining) remaining -= histogram[bin++];
    prefix |= bin << shift;
  }
  return prefix;
}

}  // namespace

CodebookReduction serial_reduction() {
  return {[](std::span<std::uint64_t>) {},
          [](std::span<const std::byte> mine) {
            return std::vector<std::vector<std::byte>>{{mine.begin(), mine.end()}};
          }};
}

std::vector<std::string> problems(const TrainingSelection& selection) {
  std::vector<std::string> found;
  if (!(selection.fraction > 0.0 && selection.fraction <= 1.0))
    found.push_back("training_fraction = " + std::to_string(selection.fraction) +
                    ": must be above 0 and at most 1");
  if (selection.max_training_tiles < 1)
    found.emplace_back("max_training_tiles = 0: must be at least 1");
  return found;
}

TrainingShare select_training_tiles(std::span<const UnitTiles> tiles,
                                    std::span<const WorkUnit> units,
                                    const LightSlab& light_slab,
                                    const TrainingSelection& selection,
                                    const CodebookReduction& reduction) {
  throw_if_any(problems(selection));
  const auto hash_of = [&](std::int64_t index) {
    return hash64(selection.seed, kTrainingStream, static_cast<std::uint64_t>(index));
  };
  const std::uint64_t last_of_fraction = last_hash_of_fraction(selection.fraction);
  std::vector<std::uint64_t> histogram(kBins, 0);
  for_each_numbered_tile(tiles, units, light_slab, [&](const NumberedTile& tile) {
    const std::uint64_t hash = hash_of(tile.global_index);
    if (hash <= last_of_fraction) ++histogram[hash >> 48u];
  });
  reduction.sum(histogram);
  const std::uint64_t last_training =
      capped_last_hash(histogram, last_of_fraction, selection.max_training_tiles);
  const std::uint64_t held_out_hashes =
      std::min(last_training / 8, (kEverything - last_training) / 2);
  TrainingShare share;
  for_each_numbered_tile(tiles, units, light_slab, [&](const NumberedTile& tile) {
    const std::uint64_t hash = hash_of(tile.global_index);
    if (hash <= last_training)
      share.training.push_back(tile);
    else if (hash > kEverything - held_out_hashes)
      share.held_out.push_back(tile);
  });
  return share;
}

std::vector<KeyedTile> smallest_keyed_tiles(std::span<const std::uint64_t> keys,
                                            std::span<const NumberedTile> tiles,
                                            std::uint64_t count,
                                            const CodebookReduction& reduction) {
  check(keys.size() == tiles.size(), "one key per tile");
  const std::uint64_t last_key = key_of_rank(keys, count, reduction);
  std::vector<KeyedTile> mine;
  for (std::size_t i = 0; i < keys.size(); ++i)
    if (keys[i] <= last_key) mine.push_back({keys[i], tiles[i]});
  std::vector<KeyedTile> picked;
  for (const auto& bytes : reduction.all_gather(std::as_bytes(std::span(mine)))) {
    const std::size_t first = picked.size();
    picked.resize(first + bytes.size() / sizeof(KeyedTile));
    if (!bytes.empty()) std::memcpy(&picked[first], bytes.data(), bytes.size());
  }
  std::sort(picked.begin(), picked.end(), [](const KeyedTile& a, const KeyedTile& b) {
    return std::tie(a.key, a.numbered.global_index) < std::tie(b.key, b.numbered.global_index);
  });
  if (picked.size() > count) picked.resize(count);
  return picked;
}

std::uint64_t weighted_sampling_key(std::uint64_t seed, const NumberedTile& tile) {
  std::uint64_t sum = 0;
  std::uint64_t sum_of_squares = 0;
  for (const std::uint64_t level : tile.tile) {
    sum += level;
    sum_of_squares += level * level;
  }
  // 16 times the squared AC norm; at least that of a norm of one level, so that flat tiles may be
  // drawn.
  const std::uint64_t energy = std::max<std::uint64_t>(16 * sum_of_squares - sum * sum, 16);
  const double weight = std::sqrt(std::sqrt(static_cast<double>(energy)));
  const std::uint64_t bits =
      hash64(seed, kInitialStream, static_cast<std::uint64_t>(tile.global_index));
  const double uniform = (static_cast<double>(bits >> 11u) + 0.5) * 0x1.0p-53;
  // Positive doubles order like their bits; log(uniform) < 0.
  return std::bit_cast<std::uint64_t>(-portable_log(uniform) / weight);
}

}  // namespace af
