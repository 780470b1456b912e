// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "register/similarity/pixel_sums.h"

namespace af::registration {

/// Cross correlation tile by tile, weighted by the X-ray's contrast (in the spirit of the
/// variance-weighted sum of local correlations of LaRose, PhD thesis, Carnegie Mellon University,
/// 2001):
///
///     TNCC = sum_T w_T NCC_T,   w_T = |x - mean_T x|_T / sum of these over tiles
///
/// The region is cut into tiles x tiles. Tiles with less than a quarter of their pixels in use are
/// left out. Shading, a heel effect or a bright rod disturbs only the tiles that it crosses.
/// \test TiledCorrelation.IgnoresAnOffsetAndAGainOfItsOwnInEveryTile
class TiledCorrelation final : public LeastSquaresMeasure {
 public:
  /// Throws InputError when the reference has problems, or no tile is left.
  TiledCorrelation(const SimilarityReference& reference, int tiles);

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& workspace) const override;
  [[nodiscard]] NormalEquations normal_equations(std::span<const float> drr,
                                                 std::span<const float> planes,
                                                 SimilarityWorkspace& workspace) const override;

 private:
  struct Tile {
    std::size_t first = 0;  ///< pixel
    PixelBlock block{};
    double weight = 0.0;
  };
  [[nodiscard]] double tile_correlation(std::span<const float> drr, const Tile& tile) const;

  int width_;
  std::vector<float> xray_;     ///< 0 where unused
  std::vector<float> weights_;  ///< 1 where used, 0 elsewhere; empty: all are
  std::vector<Tile> tiles_;
  double drr_offset_;
  double smallest_variance_;  ///< per pixel; a tile of a DRR with less is flat
};

}  // namespace af::registration
