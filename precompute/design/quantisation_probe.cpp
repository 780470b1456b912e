// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/quantisation_probe.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "precompute/codebook/codebook_training.h"
#include "precompute/codebook/tile_drawing.h"
#include "precompute/codebook/unit_encoding.h"
#include "precompute/design/packed_bytes.h"

namespace af {

namespace {

constexpr int kIterations = 5;
/// Excess of unseen tiles' squared error over that after unlimited training, times tiles per
/// codeword: 1.16 at 14 and 1.05 at 64, for a skull in the paper's design. Training tiles fall
/// short by about as much.
constexpr double kUnseenExcess = 2.5;

double trained_share_factor(double per_codeword, double trained_share) {
  return 1.0 + kUnseenExcess / std::max(per_codeword, 4.0) * (1.0 - 2.0 * trained_share);
}

}  // namespace

Codebook small_codebook(std::span<const NumberedTile> shuffled, const ProbedCodebook& wanted) {
  const std::size_t tile_count =
      kProbeTilesPerCodeword * static_cast<std::size_t>(wanted.codewords);
  const auto training = shuffled.first(std::min(shuffled.size(), tile_count));
  std::vector<Tile> distinct;
  for (const NumberedTile& tile : training) distinct.push_back(tile.tile);
  std::sort(distinct.begin(), distinct.end());
  const auto count = std::unique(distinct.begin(), distinct.end()) - distinct.begin();
  CodebookOptions options;
  options.codewords = static_cast<int>(std::min<std::ptrdiff_t>(wanted.codewords, count));
  options.max_iterations = kIterations;
  options.seed = wanted.seed;
  options.mean_step = wanted.mean_step;
  if (options.codewords < 2) return {{Tile{}}, wanted.mean_step};
  return train_codebook({{training.begin(), training.end()}, {}}, options, serial_reduction())
      .codebook;
}

double squared_error(std::span<const NumberedTile> tiles, const Codebook& codebook) {
  std::vector<Tile> plain;
  for (const NumberedTile& tile : tiles) plain.push_back(tile.tile);
  std::vector<std::uint32_t> nearest(plain.size());
  std::vector<std::uint64_t> errors(plain.size());
  NearestCodeword(codebook).search(plain, SearchHint::None, nearest, errors);
  double sum = 0.0;
  for (const std::uint64_t error : errors) sum += static_cast<double>(error);
  return std::max(sum, 1.0);
}

Codebook drawn_codebook(std::span<const NumberedTile> shuffled, const ProbedCodebook& wanted) {
  std::vector<std::uint64_t> keys;
  keys.reserve(shuffled.size());
  for (const NumberedTile& tile : shuffled)
    keys.push_back(weighted_sampling_key(wanted.seed, tile));
  const std::size_t drawn_count =
      std::min(static_cast<std::size_t>(wanted.codewords), shuffled.size() / 2 + 1) - 1;
  const auto drawn = smallest_keyed_tiles(keys, shuffled, drawn_count, serial_reduction());
  std::vector<Tile> tiles{Tile{}};
  for (const KeyedTile& tile : drawn) tiles.push_back(tile.numbered.tile);
  std::sort(tiles.begin(), tiles.end(), codeword_less);
  return codebook_of_searched(std::move(tiles), wanted.mean_step);
}

double error_ratio(const std::array<double, kProbeCodewords.size()>& errors_of_small,
                   int codewords,
                   const TrainingTiles& tiles) {
  // It is about -0.45 in practice. A field of few tiles has too few errors to estimate it.
  const double falls = std::clamp(std::log(errors_of_small[1] / errors_of_small[0]) /
                                      std::log(1.0 * kProbeCodewords[1] / kProbeCodewords[0]),
                                  -0.8,
                                  0.0);
  const double sum = falls * std::log(1.0 * codewords / kProbeCodewords[1]);
  const double share = std::min(1.0, tiles.training / std::max(tiles.occupied, 1.0));
  // A probe's training is short and sees few viewpoints.
  constexpr double kProbeExcess = 1.1;
  return std::exp(sum) / kProbeExcess * trained_share_factor(tiles.training / codewords, share) /
         trained_share_factor(static_cast<double>(kProbeTilesPerCodeword), 0.0);
}

IndexBytes index_bytes(const FieldSample::Chunk& chunk,
                       const NearestCodeword& search,
                       bool has_means) {
  const EncodedUnit encoded = encode_unit(search, chunk.unit, chunk.tiles);
  const auto row_tiles = static_cast<std::size_t>(chunk.unit.tile_counts()[3]);
  return {static_cast<double>(packed_bytes(encoded.indices, row_tiles, has_means)),
          static_cast<double>(chunk.tiles.tiles.size())};
}

}  // namespace af
