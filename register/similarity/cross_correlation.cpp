// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/cross_correlation.h"

#include <array>
#include <cmath>

#include "base/error.h"

namespace af::registration {
namespace {

class EmptyWorkspace final : public SimilarityWorkspace {};

/// Independent partial sums: additions need not wait for each other, and their order is fixed.
constexpr std::size_t kLanes = 4;

struct Sums {
  std::array<double, kLanes> product{};
  std::array<double, kLanes> value{};
  std::array<double, kLanes> square{};
};

double total(const std::array<double, kLanes>& lanes) {
  return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
}

}  // namespace

CrossCorrelation::CrossCorrelation(const SimilarityReference& reference)
    : drr_offset_((reference.drr_range.low + reference.drr_range.high) / 2.0) {
  throw_if_any(problems(reference));
  const std::size_t pixels = reference.xray.pixels.size();
  weights_.resize(pixels);
  unit_xray_.resize(pixels);
  double sum = 0.0;
  for (std::size_t i = 0; i < pixels; ++i) {
    weights_[i] = reference.is_used(i) ? 1.0f : 0.0f;
    if (!reference.is_used(i)) continue;
    used_pixels_ += 1.0;
    sum += static_cast<double>(reference.xray.pixels[i]);
  }
  const double mean = sum / used_pixels_;
  double square = 0.0;
  for (std::size_t i = 0; i < pixels; ++i) {
    if (!reference.is_used(i)) continue;
    const double centred = static_cast<double>(reference.xray.pixels[i]) - mean;
    square += centred * centred;
  }
  const double norm = std::sqrt(square);
  for (std::size_t i = 0; i < pixels; ++i)
    unit_xray_[i] =
        reference.is_used(i)
            ? static_cast<float>((static_cast<double>(reference.xray.pixels[i]) - mean) / norm)
            : 0.0f;
}

double CrossCorrelation::evaluate(std::span<const float> drr,
                                  SimilarityWorkspace& /*workspace*/) const {
  check(drr.size() == unit_xray_.size(), "the DRR must have the size of its reference");
  Sums sums;
  for (std::size_t i = 0; i < drr.size(); ++i) {
    const std::size_t lane = i % kLanes;
    const double centred =
        (static_cast<double>(drr[i]) - drr_offset_) * static_cast<double>(weights_[i]);
    sums.product[lane] += static_cast<double>(unit_xray_[i]) * centred;
    sums.value[lane] += centred;
    sums.square[lane] += centred * centred;
  }
  const double value = total(sums.value);
  const double square = total(sums.square);
  const double variance = square - value * value / used_pixels_;
  // A constant DRR leaves rounding errors of this order.
  constexpr double kRelativeRounding = 1e-12;
  if (!(variance > kRelativeRounding * square)) return std::isnan(variance) ? variance : 0.0;
  return total(sums.product) / std::sqrt(variance);
}

std::unique_ptr<SimilarityWorkspace> CrossCorrelation::make_workspace() const {
  return std::make_unique<EmptyWorkspace>();
}

}  // namespace af::registration
