// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/pixel_sums.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/vector_width.h"

namespace af::registration {
namespace {

/// A constant image leaves rounding errors of this order in its variance, because products are
/// rounded to single precision.
constexpr double kRelativeRounding = 1e-6;

/// Place of the product of channels a <= b in the upper triangle.
int product_index(int a, int b) {
  return a * kGramChannels - a * (a - 1) / 2 + (b - a);
}

}  // namespace

PixelSumKernels pixel_sum_kernels() {
#define AF_SELECT(name)                        \
  select_kernel<decltype(&kernels_128::name)>( \
      kernels_128::name, kernels_256::name, kernels_512::name)
  return {AF_SELECT(add_gram),
          AF_SELECT(correlation_sums),
          AF_SELECT(robust_sums),
          AF_SELECT(pair_sums),
          AF_SELECT(sobel),
          AF_SELECT(count_histogram)};
#undef AF_SELECT
}

GramSums gram_sums(std::span<const float> planes,
                   std::span<const float> drr,
                   std::span<const float> xray,
                   std::span<const float> weights,
                   double drr_offset,
                   std::size_t first,
                   const PixelBlock& block) {
  check(planes.size() == 6 * drr.size() && xray.size() == drr.size(),
        "six derivative planes and an X-ray of the DRR's size");
  GramChannels channels{};
  for (std::size_t i = 0; i < 6; ++i) channels.channels[i] = planes.data() + i * drr.size() + first;
  channels.channels[kDrrChannel] = drr.data() + first;
  channels.channels[kXrayChannel] = xray.data() + first;
  channels.offsets[kDrrChannel] = static_cast<float>(drr_offset);
  channels.weights = weights.empty() ? nullptr : weights.data() + first;
  GramSums sums{};
  pixel_sum_kernels().add_gram(channels, block, sums);
  return sums;
}

GramSums gram_sums(std::span<const float> planes,
                   std::span<const float> drr,
                   std::span<const float> xray,
                   std::span<const float> weights,
                   double drr_offset) {
  const auto pixels = static_cast<std::int32_t>(drr.size());
  return gram_sums(planes, drr, xray, weights, drr_offset, 0, {pixels, 1, pixels});
}

double gram_product(const GramSums& sums, int a, int b) {
  return sums.products[a <= b ? product_index(a, b) : product_index(b, a)];
}

double centered_gram_product(const GramSums& sums, int a, int b) {
  return gram_product(sums, a, b) - sums.firsts[a] * sums.firsts[b] / sums.weight;
}

NormalEquations correlation_normal_equations(const GramSums& sums, double smallest_square) {
  const double drr_square = centered_gram_product(sums, kDrrChannel, kDrrChannel);
  const double xray_square = centered_gram_product(sums, kXrayChannel, kXrayChannel);
  NormalEquations result;
  if (!(drr_square > smallest_square) || !(xray_square > 0.0)) {
    if (std::isnan(drr_square)) result.value = drr_square;
    return result;
  }
  const double drr_norm = std::sqrt(drr_square);
  const double xray_norm = std::sqrt(xray_square);
  result.value = centered_gram_product(sums, kDrrChannel, kXrayChannel) / (drr_norm * xray_norm);
  PoseVector along_drr;
  for (int k = 0; k < 6; ++k) {
    along_drr[k] = centered_gram_product(sums, k, kDrrChannel) / drr_norm;
    result.gradient[k] =
        (centered_gram_product(sums, k, kXrayChannel) / xray_norm - result.value * along_drr[k]) /
        drr_norm;
  }
  for (int k = 0; k < 6; ++k)
    for (int l = 0; l < 6; ++l)
      result.matrix(k, l) =
          (centered_gram_product(sums, k, l) - along_drr[k] * along_drr[l]) / drr_square;
  return result;
}

NormalEquations correlation_normal_equations(const GramSums& sums) {
  return correlation_normal_equations(
      sums, kRelativeRounding * gram_product(sums, kDrrChannel, kDrrChannel));
}

std::vector<float> pixel_weights(const SimilarityReference& reference) {
  std::vector<float> weights;
  for (const std::uint8_t used : reference.used) weights.push_back(used != 0 ? 1.0f : 0.0f);
  return weights;
}

double weight_sum(std::span<const float> weights, std::size_t pixels) {
  if (weights.empty()) return static_cast<double>(pixels);
  double sum = 0.0;
  for (const float weight : weights) sum += static_cast<double>(weight);
  return sum;
}

std::vector<float> unit_image(std::span<const float> image, std::span<const float> weights) {
  const auto is_used = [&](std::size_t i) { return weights.empty() || weights[i] != 0.0f; };
  double sum = 0.0;
  for (std::size_t i = 0; i < image.size(); ++i)
    if (is_used(i)) sum += static_cast<double>(image[i]);
  const double mean = sum / weight_sum(weights, image.size());
  double square = 0.0;
  for (std::size_t i = 0; i < image.size(); ++i)
    if (is_used(i)) square += std::pow(static_cast<double>(image[i]) - mean, 2);
  std::vector<float> unit(image.size(), 0.0f);
  if (!(square > 0.0)) return unit;
  for (std::size_t i = 0; i < image.size(); ++i)
    if (is_used(i))
      unit[i] = static_cast<float>((static_cast<double>(image[i]) - mean) / std::sqrt(square));
  return unit;
}

UnitCorrelation correlate(std::span<const float> image,
                          std::span<const float> unit_reference,
                          std::span<const float> weights,
                          double used_pixels,
                          double offset) {
  const auto single_offset = static_cast<float>(offset);
  const CorrelationSums sums =
      pixel_sum_kernels().correlation_sums(image.data(),
                                           unit_reference.data(),
                                           weights.empty() ? nullptr : weights.data(),
                                           single_offset,
                                           static_cast<std::int32_t>(image.size()));
  UnitCorrelation result;
  const double mean = sums.value / used_pixels;
  result.mean = mean + static_cast<double>(single_offset);
  const double variance = sums.square - sums.value * mean;
  if (std::isnan(variance)) result.value = variance;
  if (!(variance > kRelativeRounding * sums.square)) return result;
  result.norm = std::sqrt(variance);
  result.value = sums.product / result.norm;
  return result;
}

void correlation_derivative(const UnitCorrelation& correlation,
                            std::span<const float> image,
                            std::span<const float> unit_reference,
                            std::span<const float> weights,
                            std::span<float> derivative) {
  if (!(correlation.norm > 0.0)) {
    std::fill(derivative.begin(), derivative.end(), 0.0f);
    return;
  }
  const auto mean = static_cast<float>(correlation.mean);
  const auto by_norm = static_cast<float>(1.0 / correlation.norm);
  const auto shrink = static_cast<float>(correlation.value / correlation.norm);
  for (std::size_t i = 0; i < image.size(); ++i) {
    const float slope = by_norm * (unit_reference[i] - shrink * (image[i] - mean));
    derivative[i] = weights.empty() ? slope : weights[i] * slope;
  }
}

}  // namespace af::registration
