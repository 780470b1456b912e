// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/tile_drawing.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <tuple>

#include "base/error.h"
#include "base/hash_random.h"

namespace af {

namespace {

constexpr std::uint64_t kInitialStream = 0x696E'6974'6961'6C00;  // "initial"

/// Natural logarithm for (0, 1], accurate to about 1e-12: exponent and an atanh series. It uses
/// only correctly rounded operations, because libm's last bit differs between processors.
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

/// Finds the key of the `count`-th smallest, by the four summed histograms of a radix search.
std::uint64_t key_of_rank(std::span<const std::uint64_t> keys,
                          std::uint64_t count,
                          const CodebookReduction& reduction) {
  constexpr std::size_t kRadix = 65536;
  std::uint64_t prefix = 0;
  std::uint64_t remaining = count;
  for (int shift = 48; shift >= 0; shift -= 16) {
    std::vector<std::uint64_t> histogram(kRadix, 0);
    for (const std::uint64_t key : keys)
      if (key == kNeverPicked)
        continue;
      else if (shift == 48 || (key >> (shift + 16)) == (prefix >> (shift + 16)))
        ++histogram[(key >> shift) & 0xFFFFu];
    reduction.sum(histogram);
    std::uint64_t bin = 0;
    while (bin + 1 < kRadix && histogram[bin] < remaining) remaining -= histogram[bin++];
    prefix |= bin << shift;
  }
  return prefix;
}

}  // namespace

std::vector<KeyedTile> smallest_keyed_tiles(std::span<const std::uint64_t> keys,
                                            std::span<const NumberedTile> tiles,
                                            std::uint64_t count,
                                            const CodebookReduction& reduction) {
  check(keys.size() == tiles.size(), "one key per tile");
  const std::uint64_t last_key = key_of_rank(keys, count, reduction);
  std::vector<KeyedTile> mine;
  for (std::size_t i = 0; i < keys.size(); ++i)
    if (keys[i] <= last_key && keys[i] != kNeverPicked) mine.push_back({keys[i], tiles[i]});
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
  // 16 times the squared AC norm. It is at least that of a norm of one level, so that flat tiles
  // may be drawn.
  const std::uint64_t energy = std::max<std::uint64_t>(16 * sum_of_squares - sum * sum, 16);
  const double weight = std::sqrt(std::sqrt(static_cast<double>(energy)));
  const std::uint64_t bits =
      hash64(seed, kInitialStream, static_cast<std::uint64_t>(tile.global_index));
  const double uniform = (static_cast<double>(bits >> 11u) + 0.5) * 0x1.0p-53;
  // Positive doubles have the order of their bits, and log(uniform) < 0.
  return std::bit_cast<std::uint64_t>(-portable_log(uniform) / weight);
}

}  // namespace af
