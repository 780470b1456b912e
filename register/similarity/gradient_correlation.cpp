// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/gradient_correlation.h"

#include <algorithm>

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {

GradientCorrelation::GradientCorrelation(const SimilarityReference& reference)
    : reference_(reference) {
  unit_xray_.along_columns = unit_image(reference_.xray.along_columns, reference_.weights);
  unit_xray_.along_rows = unit_image(reference_.xray.along_rows, reference_.weights);
}

double GradientCorrelation::evaluate(std::span<const float> drr,
                                     SimilarityWorkspace& workspace) const {
  auto& mine = dynamic_cast<GradientWorkspace&>(workspace);
  take_gradients(reference_, drr, mine);
  double sum = 0.0;
  for (int direction = 0; direction < 2; ++direction)
    sum += correlate(mine.drr.of(direction),
                     unit_xray_.of(direction),
                     reference_.weights,
                     reference_.used_pixels,
                     0.0)
               .value;
  return sum / 2.0;
}

double GradientCorrelation::evaluate_with_derivative(std::span<const float> drr,
                                                     std::span<float> derivative,
                                                     SimilarityWorkspace& workspace) const {
  check(derivative.size() == drr.size(), "one derivative per pixel");
  auto& mine = dynamic_cast<GradientWorkspace&>(workspace);
  take_gradients(reference_, drr, mine);
  mine.derivative.resize(drr.size());
  std::fill(derivative.begin(), derivative.end(), 0.0f);
  double sum = 0.0;
  for (int direction = 0; direction < 2; ++direction) {
    const std::vector<float>& image = mine.drr.of(direction);
    const std::vector<float>& unit = unit_xray_.of(direction);
    const UnitCorrelation correlation =
        correlate(image, unit, reference_.weights, reference_.used_pixels, 0.0);
    correlation_derivative(correlation, image, unit, reference_.weights, mine.derivative);
    for (float& value : mine.derivative) value *= 0.5f;
    add_adjoint_gradient(reference_, direction, mine.derivative, mine, derivative);
    sum += correlation.value;
  }
  return sum / 2.0;
}

NormalEquations GradientCorrelation::normal_equations(std::span<const float> drr,
                                                      std::span<const float> planes,
                                                      SimilarityWorkspace& workspace) const {
  auto& mine = dynamic_cast<GradientWorkspace&>(workspace);
  take_gradients(reference_, drr, planes, mine);
  NormalEquations result;
  for (int direction = 0; direction < 2; ++direction)
    result +=
        correlation_normal_equations(gram_sums(mine.planes[static_cast<std::size_t>(direction)],
                                               mine.drr.of(direction),
                                               unit_xray_.of(direction),
                                               reference_.weights));
  result.value /= 2.0;
  result.gradient /= 2.0;
  result.matrix /= 2.0;
  return result;
}

std::unique_ptr<SimilarityWorkspace> GradientCorrelation::make_workspace() const {
  return make_gradient_workspace(reference_);
}

}  // namespace af::registration
