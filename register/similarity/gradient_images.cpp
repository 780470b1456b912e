// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/gradient_images.h"

#include <algorithm>

#include "base/error.h"

namespace af::registration {
namespace {

/// A pixel counts when it and its eight neighbours do.
std::vector<float> interior_weights(const SimilarityReference& reference) {
  const int width = reference.xray.width;
  const int height = reference.xray.height;
  std::vector<float> weights(reference.xray.pixels.size(), 0.0f);
  const auto index = [&](int column, int row) {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(column);
  };
  for (int row = 1; row + 1 < height; ++row)
    for (int column = 1; column + 1 < width; ++column) {
      bool is_used = true;
      for (int i = 0; i < 9; ++i)
        is_used = is_used && reference.is_used(index(column - 1 + i % 3, row - 1 + i / 3));
      weights[index(column, row)] = is_used ? 1.0f : 0.0f;
    }
  return weights;
}

}  // namespace

void GradientPair::resize(std::size_t pixels) {
  along_columns.resize(pixels);
  along_rows.resize(pixels);
}

GradientReference::GradientReference(const SimilarityReference& reference)
    : width(reference.xray.width), height(reference.xray.height) {
  throw_if_any(problems(reference));
  weights = interior_weights(reference);
  used_pixels = weight_sum(weights, weights.size());
  if (!(used_pixels > 0.0))
    throw InputError(
        "region of interest = no 3 x 3 pixels in use: gradient measures need some (mask, size)");
  Image2d image = reference.xray;
  // What a mask hides may be anything, including NaN.
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    if (!reference.is_used(i)) image.pixels[i] = 0.0f;
  xray.resize(image.pixels.size());
  pixel_sum_kernels().sobel(
      image.pixels.data(), width, height, xray.along_columns.data(), xray.along_rows.data());
}

std::unique_ptr<GradientWorkspace> make_gradient_workspace(const GradientReference& reference) {
  auto workspace = std::make_unique<GradientWorkspace>();
  workspace->drr.resize(reference.weights.size());
  workspace->robust_weights.resize(reference.weights.size());
  workspace->curvature_weights.resize(reference.weights.size());
  return workspace;
}

void take_gradients(const GradientReference& reference,
                    std::span<const float> drr,
                    GradientWorkspace& workspace) {
  check(drr.size() == reference.weights.size(), "the DRR must have the size of its reference");
  pixel_sum_kernels().sobel(drr.data(),
                            reference.width,
                            reference.height,
                            workspace.drr.along_columns.data(),
                            workspace.drr.along_rows.data());
}

void take_gradients(const GradientReference& reference,
                    std::span<const float> drr,
                    std::span<const float> planes,
                    GradientWorkspace& workspace) {
  take_gradients(reference, drr, workspace);
  check(planes.size() == 6 * drr.size(), "six derivative planes of the DRR's size");
  for (std::vector<float>& direction : workspace.planes) direction.resize(planes.size());
  const PixelSumKernels kernels = pixel_sum_kernels();
  for (std::size_t k = 0; k < 6; ++k)
    kernels.sobel(planes.data() + k * drr.size(),
                  reference.width,
                  reference.height,
                  workspace.planes[0].data() + k * drr.size(),
                  workspace.planes[1].data() + k * drr.size());
}

void add_adjoint_gradient(const GradientReference& reference,
                          int direction,
                          std::span<const float> by_gradient,
                          GradientWorkspace& workspace,
                          std::span<float> by_pixel) {
  // Sobel's weights change sign when they are rotated by half a turn. The adjoint is therefore
  // minus the operator, over an image with a border of zeros.
  const int width = reference.width + 2;
  const int height = reference.height + 2;
  const auto row_pixels = static_cast<std::size_t>(reference.width);
  const auto padded_at = [&](int row) {
    return static_cast<std::size_t>(row + 1) * static_cast<std::size_t>(width) + 1;
  };
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  workspace.padded.assign(pixels, 0.0f);
  workspace.padded_gradients.resize(pixels);
  for (int row = 0; row < reference.height; ++row)
    std::copy_n(by_gradient.data() + static_cast<std::size_t>(row) * row_pixels,
                row_pixels,
                workspace.padded.data() + padded_at(row));
  pixel_sum_kernels().sobel(workspace.padded.data(),
                            width,
                            height,
                            workspace.padded_gradients.along_columns.data(),
                            workspace.padded_gradients.along_rows.data());
  const std::vector<float>& filtered = workspace.padded_gradients.of(direction);
  for (int row = 0; row < reference.height; ++row)
    for (std::size_t column = 0; column < row_pixels; ++column)
      by_pixel[static_cast<std::size_t>(row) * row_pixels + column] -=
          filtered[padded_at(row) + column];
}

double least_squares_gain(const GradientReference& reference, const GradientPair& drr) {
  double product = 0.0;
  double square = 0.0;
  for (int direction = 0; direction < 2; ++direction) {
    const CorrelationSums sums =
        pixel_sum_kernels().correlation_sums(drr.of(direction).data(),
                                             reference.xray.of(direction).data(),
                                             reference.weights.data(),
                                             0.0f,
                                             static_cast<std::int32_t>(reference.weights.size()));
    product += sums.product;
    square += sums.square;
  }
  return square > 0.0 ? std::max(0.0, product / square) : 0.0;
}

}  // namespace af::registration
