// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "field/codebook.h"
#include "precompute/codebook/nearest_codeword.h"
#include "precompute/codebook/tile_selection.h"
#include "precompute/design/field_sample.h"

namespace af {

/// Sizes of the small codebooks that a probe trains, because real ones would take too long.
inline constexpr std::array<int, 2> kProbeCodewords = {512, 2048};
/// Training tiles per codeword of each small codebook.
inline constexpr std::size_t kProbeTilesPerCodeword = 32;
/// How many tiles train none of them, if there are that many.
inline constexpr std::size_t kProbeUnseenTiles = 8192;

/// Tiles that a probe needs for a field with this many codewords: for the largest small codebook,
/// and to draw from.
constexpr std::size_t probe_tiles(int codewords) {
  return std::max(
      kProbeTilesPerCodeword * static_cast<std::size_t>(kProbeCodewords.back()) + kProbeUnseenTiles,
      2 * static_cast<std::size_t>(codewords));
}

/// Specification of a probe's codebook.
struct ProbedCodebook {
  int codewords;
  int mean_step;  ///< for mean-removed tiles; 0: plain ones
  std::uint64_t seed;
};

/// Trains a codebook as for a field, on the first tiles of `shuffled`, kProbeTilesPerCodeword per
/// codeword: on plain tiles, or on folded shapes (remove_means()) where `wanted.mean_step` is above
/// 0. It has fewer codewords when there are too few tiles.
Codebook small_codebook(std::span<const NumberedTile> shuffled, const ProbedCodebook& wanted);

/// A full-size codebook whose codewords are drawn, not trained, because its indices compress like a
/// field's. It has fewer codewords when there are less than twice as many tiles.
Codebook drawn_codebook(std::span<const NumberedTile> shuffled, const ProbedCodebook& wanted);

/// Sum over tiles, or folded shapes, of the squared distance to the nearest codeword, in levels.
double squared_error(std::span<const NumberedTile> tiles, const Codebook& codebook);

/// What a field's codebook will be trained on.
struct TrainingTiles {
  double training = 0.0;
  double occupied = 0.0;  ///< tiles of the whole field that are not empty
};

/// A field's squared error with `codewords` relative to that with the largest small codebook,
/// extrapolated from the small codebooks' errors by a straight line in the logarithms. Training
/// tiles are coded better than unseen ones, especially with few tiles per codeword.
double error_ratio(const std::array<double, kProbeCodewords.size()>& errors_of_small,
                   int codewords,
                   const TrainingTiles& tiles);

/// Bytes of the indices (and means) of a chunk in a field's file, and its tiles that are not empty.
struct IndexBytes {
  double bytes = 0.0;
  double tiles = 0.0;
};
IndexBytes index_bytes(const FieldSample::Chunk& chunk,
                       const NearestCodeword& search,
                       bool has_means);

/// Bytes of a codebook in a file, deflated, per codeword.
inline constexpr double kFileBytesPerCodeword = 17.0;

}  // namespace af
