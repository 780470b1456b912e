// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af::registration {

/// A rectangle of pixels inside images whose rows are `stride` pixels apart.
struct PixelBlock {
  int32_t width;
  int32_t height;
  int32_t stride;
};

inline constexpr int kGramChannels = 8;
inline constexpr int kGramProducts = kGramChannels * (kGramChannels + 1) / 2;

/// Images to be multiplied with each other, each pointing at the block's first pixel.
struct GramChannels {
  const float* channels[kGramChannels];
  const float* weights;          ///< nullptr: 1 everywhere
  float offsets[kGramChannels];  ///< subtracted first
};

/// Sums over a block: products of channels i <= j (row by row of the upper triangle), the channels
/// themselves, and the weights.
struct GramSums {
  double products[kGramProducts];
  double firsts[kGramChannels];
  double weight;
};

/// What a correlation needs from a DRR d: sums of w d, w d d and w x d.
struct CorrelationSums {
  double value;
  double square;
  double product;
};

/// Sums over residuals r = x - gain d with q = w (s / (s + r r))^2, where s is the squared scale: q
/// x d, q d d, and the saturating cost w r r / (s + r r) (Geman, McClure).
struct RobustSums {
  double product;
  double square;
  double cost;
};

struct RobustRequest {
  const float* x;
  const float* d;
  const float* weights;
  float gain;
  float squared_scale;
  float* robust_weights;     ///< receives q; nullptr: not wanted
  float* curvature_weights;  ///< likewise q (s - 3 r r) / (s + r r), with which the cost curves
};

/// Bins of the joint histogram: cell = row offset of the pixel + bin of the DRR value.
struct HistogramRequest {
  const float* drr;
  const uint32_t* row_offsets;
  float low;
  float bins_per_unit;
  float last_bin;
  uint32_t* counts;  ///< kHistogramCopies histograms of `cells`, one after the other
  int32_t cells;
};
inline constexpr int kHistogramCopies = 4;

/// Sum over used pixel pairs of s / (s + (e_i - e_{i + shift})^2), where e = x - gain d.
struct PairRequest {
  const float* difference;
  const float* weights;
  int32_t shift;  ///< to the other pixel of each pair, >= 0
  float squared_scale;
};
struct PairSums {
  double likeness;
  double pairs;
};

// clang-format off
#define AF_DECLARE_PIXEL_SUMS(variant)                                                              \
  namespace variant {                                                                               \
  /** Adds to `sums`. */                                                                            \
  void add_gram(const GramChannels& request, const PixelBlock& block, GramSums& sums);              \
  CorrelationSums correlation_sums(const float* d, const float* x, const float* weights,            \
                                   float offset, int32_t count);                                    \
  RobustSums robust_sums(const RobustRequest& request, int32_t count);                              \
  PairSums pair_sums(const PairRequest& request, int32_t count);                                    \
  /** Sobel's derivatives along columns and rows, divided by 8, of all but the border, where they   \
      are 0. */                                                                                     \
  void sobel(const float* image, int32_t width, int32_t height, float* along_columns,               \
             float* along_rows);                                                                    \
  void count_histogram(const HistogramRequest& request, int32_t count);                             \
  }
// clang-format on
AF_DECLARE_PIXEL_SUMS(kernels_128)
AF_DECLARE_PIXEL_SUMS(kernels_256)
AF_DECLARE_PIXEL_SUMS(kernels_512)
#undef AF_DECLARE_PIXEL_SUMS

}  // namespace af::registration
