// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/gradient_orientation.h"

#include <algorithm>
#include <cmath>

namespace af::registration {
namespace {

/// Squared lengths of the gradients of used pixels; `lengths` is overwritten. Returns their median.
float median_square(const GradientPair& gradients,
                    std::span<const float> weights,
                    std::vector<float>& squares) {
  squares.clear();
  for (std::size_t i = 0; i < weights.size(); ++i)
    if (weights[i] != 0.0f)
      squares.push_back(gradients.along_columns[i] * gradients.along_columns[i] +
                        gradients.along_rows[i] * gradients.along_rows[i]);
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  return *middle;
}

}  // namespace

GradientOrientation::GradientOrientation(const SimilarityReference& reference)
    : reference_(reference), strong_xray_(reference_.weights) {
  std::vector<float> squares;
  const float median = median_square(reference_.xray, reference_.weights, squares);
  for (std::size_t i = 0; i < strong_xray_.size(); ++i) {
    const float column = reference_.xray.along_columns[i];
    const float row = reference_.xray.along_rows[i];
    if (!(column * column + row * row > median)) strong_xray_[i] = 0.0f;
  }
}

double GradientOrientation::evaluate(std::span<const float> drr,
                                     SimilarityWorkspace& workspace) const {
  auto& mine = dynamic_cast<GradientWorkspace&>(workspace);
  take_gradients(reference_, drr, mine);
  const float median = median_square(mine.drr, reference_.weights, mine.derivative);
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < drr.size(); ++i) {
    const float d_column = mine.drr.along_columns[i];
    const float d_row = mine.drr.along_rows[i];
    if (strong_xray_[i] == 0.0f || !(d_column * d_column + d_row * d_row > median)) continue;
    const float x_column = reference_.xray.along_columns[i];
    const float x_row = reference_.xray.along_rows[i];
    const double angle =
        std::abs(std::atan2(static_cast<double>(x_column * d_row - x_row * d_column),
                            static_cast<double>(x_column * d_column + x_row * d_row)));
    sum += (2.0 - std::log1p(angle)) / 2.0;
    count += 1.0;
  }
  return sum / std::max(count, reference_.used_pixels / 2.0);
}

std::unique_ptr<SimilarityWorkspace> GradientOrientation::make_workspace() const {
  auto workspace = make_gradient_workspace(reference_);
  workspace->derivative.reserve(reference_.weights.size());
  return workspace;
}

}  // namespace af::registration
