// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/robust_gradient.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace af::registration {
namespace {

/// Reweighted steps of the gain. Each step costs a pass over the pixels.
constexpr int kGainSteps = 3;

double median_gradient(const GradientReference& reference) {
  std::vector<double> lengths;
  for (std::size_t i = 0; i < reference.weights.size(); ++i)
    if (reference.weights[i] != 0.0f)
      lengths.push_back(std::hypot(static_cast<double>(reference.xray.along_columns[i]),
                                   static_cast<double>(reference.xray.along_rows[i])));
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

/// Products of the six derivatives after the gain has followed them, which removes their parts
/// along the DRR.
PoseMatrix without_gain(const GramSums& sums) {
  const double square = gram_product(sums, kDrrChannel, kDrrChannel);
  PoseMatrix products;
  for (int k = 0; k < 6; ++k)
    for (int l = 0; l < 6; ++l) products(k, l) = gram_product(sums, k, l);
  if (!(square > 0.0)) return products;
  PoseVector along;
  for (int k = 0; k < 6; ++k) along[k] = gram_product(sums, k, kDrrChannel);
  return products - along * along.transpose() / square;
}

}  // namespace

RobustGradient::RobustGradient(const SimilarityReference& reference, double residual_scale)
    : reference_(reference),
      squared_scale_(std::pow(residual_scale * median_gradient(reference_), 2)) {
  if (!(squared_scale_ > 0.0))
    throw InputError("X-ray = no gradient over most of the region of interest: rg needs one");
  cost_without_drr_ = sums_at(reference_.xray, 0.0).cost;
}

RobustSums RobustGradient::sums_at(const GradientPair& drr, double gain) const {
  RobustSums sums{};
  for (int direction = 0; direction < 2; ++direction) {
    const RobustSums part =
        pixel_sum_kernels().robust_sums({reference_.xray.of(direction).data(),
                                         drr.of(direction).data(),
                                         reference_.weights.data(),
                                         static_cast<float>(gain),
                                         static_cast<float>(squared_scale_),
                                         nullptr,
                                         nullptr},
                                        static_cast<std::int32_t>(reference_.weights.size()));
    sums.product += part.product;
    sums.square += part.square;
    sums.cost += part.cost;
  }
  return sums;
}

double RobustGradient::gain_of(const GradientPair& drr) const {
  double gain = least_squares_gain(reference_, drr);
  for (int step = 0; step < kGainSteps; ++step) {
    const RobustSums sums = sums_at(drr, gain);
    if (!(sums.square > 0.0)) return 0.0;
    gain = std::max(0.0, sums.product / sums.square);
  }
  return gain;
}

double RobustGradient::evaluate(std::span<const float> drr, SimilarityWorkspace& workspace) const {
  auto& mine = dynamic_cast<GradientWorkspace&>(workspace);
  take_gradients(reference_, drr, mine);
  return 1.0 - sums_at(mine.drr, gain_of(mine.drr)).cost / cost_without_drr_;
}

double RobustGradient::take_weights(int direction,
                                    double gain,
                                    GradientWorkspace& workspace) const {
  return pixel_sum_kernels()
      .robust_sums({reference_.xray.of(direction).data(),
                    workspace.drr.of(direction).data(),
                    reference_.weights.data(),
                    static_cast<float>(gain),
                    static_cast<float>(squared_scale_),
                    workspace.robust_weights.data(),
                    workspace.curvature_weights.data()},
                   static_cast<std::int32_t>(reference_.weights.size()))
      .cost;
}

double RobustGradient::evaluate_with_derivative(std::span<const float> drr,
                                                std::span<float> derivative,
                                                SimilarityWorkspace& workspace) const {
  check(derivative.size() == drr.size(), "one derivative per pixel");
  auto& mine = dynamic_cast<GradientWorkspace&>(workspace);
  take_gradients(reference_, drr, mine);
  const double gain = gain_of(mine.drr);
  mine.derivative.resize(drr.size());
  std::fill(derivative.begin(), derivative.end(), 0.0f);
  // d rho / d r = 2 q r / s^2 with q = (s^2 / (s^2 + r^2))^2. The gain is at its best, so its own
  // change does not count.
  const auto scale = static_cast<float>(2.0 * gain / (squared_scale_ * cost_without_drr_));
  const auto single_gain = static_cast<float>(gain);
  double cost = 0.0;
  for (int direction = 0; direction < 2; ++direction) {
    cost += take_weights(direction, gain, mine);
    const std::vector<float>& x = reference_.xray.of(direction);
    const std::vector<float>& d = mine.drr.of(direction);
    for (std::size_t i = 0; i < drr.size(); ++i)
      mine.derivative[i] = scale * mine.robust_weights[i] * (x[i] - single_gain * d[i]);
    add_adjoint_gradient(reference_, direction, mine.derivative, mine, derivative);
  }
  return 1.0 - cost / cost_without_drr_;
}

NormalEquations RobustGradient::normal_equations(std::span<const float> drr,
                                                 std::span<const float> planes,
                                                 SimilarityWorkspace& workspace) const {
  auto& mine = dynamic_cast<GradientWorkspace&>(workspace);
  take_gradients(reference_, drr, planes, mine);
  const double gain = gain_of(mine.drr);
  GramSums sums{};
  GramSums curving{};
  double cost = 0.0;
  for (int direction = 0; direction < 2; ++direction) {
    cost += take_weights(direction, gain, mine);
    const auto add_sums = [&](std::span<const float> weights, GramSums& to) {
      const GramSums part = gram_sums(mine.planes[static_cast<std::size_t>(direction)],
                                      mine.drr.of(direction),
                                      reference_.xray.of(direction),
                                      weights);
      for (int i = 0; i < kGramProducts; ++i) to.products[i] += part.products[i];
    };
    add_sums(mine.robust_weights, sums);
    add_sums(mine.curvature_weights, curving);
  }
  NormalEquations result;
  result.value = 1.0 - cost / cost_without_drr_;
  const double drr_square = gram_product(sums, kDrrChannel, kDrrChannel);
  if (!(drr_square > 0.0)) return result;
  const double scale = 2.0 / (squared_scale_ * cost_without_drr_);
  for (int k = 0; k < 6; ++k)
    result.gradient[k] =
        scale * gain *
        (gram_product(sums, k, kXrayChannel) - gain * gram_product(sums, k, kDrrChannel));
  result.matrix = scale * gain * gain * without_gain(sums);
  result.reweighting = result.matrix - scale * gain * gain * without_gain(curving);
  return result;
}

std::unique_ptr<SimilarityWorkspace> RobustGradient::make_workspace() const {
  return make_gradient_workspace(reference_);
}

}  // namespace af::registration
