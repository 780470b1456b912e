// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "register/similarity/pixel_sums_kernel.h"
#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// The kernels of pixel_sums_kernel.h in the active vector width.
struct PixelSumKernels {
  decltype(&kernels_128::add_gram) add_gram;
  decltype(&kernels_128::correlation_sums) correlation_sums;
  decltype(&kernels_128::robust_sums) robust_sums;
  decltype(&kernels_128::pair_sums) pair_sums;
  decltype(&kernels_128::sobel) sobel;
  decltype(&kernels_128::count_histogram) count_histogram;
};
PixelSumKernels pixel_sum_kernels();

/// Channels of a Gram matrix as the measures use it: six derivative planes, DRR, X-ray.
inline constexpr int kDrrChannel = 6;
inline constexpr int kXrayChannel = 7;

/// Gram sums of six planes (`plane_pixels` apart), a DRR and an X-ray over a block that begins at
/// pixel `first`. Empty `weights`: 1 everywhere.
GramSums gram_sums(std::span<const float> planes,
                   std::span<const float> drr,
                   std::span<const float> xray,
                   std::span<const float> weights,
                   double drr_offset,
                   std::size_t first,
                   const PixelBlock& block);

/// The same over whole images.
GramSums gram_sums(std::span<const float> planes,
                   std::span<const float> drr,
                   std::span<const float> xray,
                   std::span<const float> weights,
                   double drr_offset = 0.0);

/// Sum of the products of two channels.
double gram_product(const GramSums& sums, int a, int b);

/// Sum of the products of two channels after their means are subtracted.
double centered_gram_product(const GramSums& sums, int a, int b);

/// Correlation of DRR and X-ray as 1 - |x^ - d^|^2 / 2 of the centred images divided by their
/// norms. It is 0, without gradient, where the sum of squares of the centred DRR is below
/// `smallest_square`.
NormalEquations correlation_normal_equations(const GramSums& sums, double smallest_square);

/// The same, but 0 where correlate() gives 0: where the DRR is constant up to rounding.
NormalEquations correlation_normal_equations(const GramSums& sums);

/// 1 where a pixel counts, 0 elsewhere. Empty when all do.
std::vector<float> pixel_weights(const SimilarityReference& reference);

/// Centres an image over the pixels of weight 1 and divides it by its norm there. It is 0
/// elsewhere. An image that is constant there becomes 0.
std::vector<float> unit_image(std::span<const float> image, std::span<const float> weights);

/// Sum of the weights, or `pixels` when there are none.
double weight_sum(std::span<const float> weights, std::size_t pixels);

/// Mean, norm and correlation of an image with a centred image of norm 1.
struct UnitCorrelation {
  double value = 0.0;  ///< 0 when the image is constant
  double mean = 0.0;
  double norm = 0.0;  ///< of the centred image; 0 when it is constant
};

/// Over the pixels of weight 1, or all if no weights are given.
UnitCorrelation correlate(std::span<const float> image,
                          std::span<const float> unit_reference,
                          std::span<const float> weights,
                          double used_pixels,
                          double offset);

/// Derivative of the correlation with respect to every pixel of the image.
void correlation_derivative(const UnitCorrelation& correlation,
                            std::span<const float> image,
                            std::span<const float> unit_reference,
                            std::span<const float> weights,
                            std::span<float> derivative);

}  // namespace af::registration
