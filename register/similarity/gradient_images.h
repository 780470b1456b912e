// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "register/similarity/pixel_sums.h"

namespace af::registration {

/// Derivatives of an image along columns and along rows, by Sobel's weights divided by 8 (per
/// pixel); 0 on the border.
struct GradientPair {
  std::vector<float> along_columns;
  std::vector<float> along_rows;

  void resize(std::size_t pixels);
  [[nodiscard]] const std::vector<float>& of(int direction) const {
    return direction == 0 ? along_columns : along_rows;
  }
};

/// The X-ray's gradients, and where they can be trusted.
struct GradientReference {
  /// Throws InputError when the reference has problems or is smaller than 3 x 3 pixels.
  explicit GradientReference(const SimilarityReference& reference);

  int width = 0;
  int height = 0;
  GradientPair xray;
  std::vector<float> weights;  ///< 1 where all 3 x 3 neighbours are used, 0 elsewhere
  double used_pixels = 0.0;
};

/// Scratch memory of the measures that work on gradients.
class GradientWorkspace final : public SimilarityWorkspace {
 public:
  GradientPair drr;
  /// Gradients of the six derivative planes, [direction]. Allocated at the first use.
  std::array<std::vector<float>, 2> planes;
  std::vector<float> robust_weights;
  std::vector<float> curvature_weights;
  std::vector<float> derivative;
  std::vector<float> padded;
  GradientPair padded_gradients;
};

/// A workspace sized for `reference`.
std::unique_ptr<GradientWorkspace> make_gradient_workspace(const GradientReference& reference);

/// Fills workspace.drr.
void take_gradients(const GradientReference& reference,
                    std::span<const float> drr,
                    GradientWorkspace& workspace);
/// Fills workspace.drr and workspace.planes.
void take_gradients(const GradientReference& reference,
                    std::span<const float> drr,
                    std::span<const float> planes,
                    GradientWorkspace& workspace);

/// Adds to `by_pixel` what derivatives with respect to the gradients along columns (direction 0) or
/// rows (1) mean for the image: the adjoint of Sobel's operator.
void add_adjoint_gradient(const GradientReference& reference,
                          int direction,
                          std::span<const float> by_gradient,
                          GradientWorkspace& workspace,
                          std::span<float> by_pixel);

/// The gain a that minimises the sum of (x - a d)^2 over both directions. 0 when d is flat or the
/// gain would be negative.
double least_squares_gain(const GradientReference& reference, const GradientPair& drr);

}  // namespace af::registration
