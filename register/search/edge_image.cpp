// SPDX-License-Identifier: Apache-2.0
#include "register/search/edge_image.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/vector_width.h"
#include "register/search/edge_correlation_kernel.h"
#include "register/similarity/gradient_images.h"

namespace af::registration {
namespace {

/// The root mean square of edges that are not 0, in steps: five times as strong an edge is still
/// told apart from a stronger one.
constexpr float kRmsSteps = 51.0f;

/// Numbers that kernels may read behind the last edge.
constexpr std::size_t kReadBeyond = 2 * kPixelsReadBeyond;

/// Whether a pixel and its neighbours are used, which its gradient looks at.
bool is_all_used(const Image2d& image, std::span<const std::uint8_t> used, int column, int row) {
  for (int r = row - 1; r <= row + 1; ++r)
    for (int c = column - 1; c <= column + 1; ++c)
      if (used[static_cast<std::size_t>(r) * static_cast<std::size_t>(image.width) +
               static_cast<std::size_t>(c)] == 0)
        return false;
  return true;
}

/// g / sqrt|g| along columns and rows of every pixel.
std::vector<float> compressed_gradients(const Image2d& image, std::span<const std::uint8_t> used) {
  GradientPair gradients;
  gradients.resize(image.pixels.size());
  pixel_sum_kernels().sobel(image.pixels.data(),
                            image.width,
                            image.height,
                            gradients.along_columns.data(),
                            gradients.along_rows.data());
  std::vector<float> edges(2 * image.pixels.size(), 0.0f);
  for (int row = 1; row + 1 < image.height; ++row)
    for (int column = 1; column + 1 < image.width; ++column) {
      if (!used.empty() && !is_all_used(image, used, column, row)) continue;
      const std::size_t at = static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) +
                             static_cast<std::size_t>(column);
      const float x = gradients.along_columns[at];
      const float y = gradients.along_rows[at];
      const float root = std::sqrt(std::sqrt(x * x + y * y));
      if (!(root > 0.0f) || !std::isfinite(root)) continue;
      edges[2 * at] = x / root;
      edges[2 * at + 1] = y / root;
    }
  return edges;
}

/// Steps per unit of an edge.
float steps_per_unit(const std::vector<float>& edges) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < edges.size(); i += 2) {
    const double square = static_cast<double>(edges[i]) * static_cast<double>(edges[i]) +
                          static_cast<double>(edges[i + 1]) * static_cast<double>(edges[i + 1]);
    sum += square;
    count += square > 0.0 ? 1 : 0;
  }
  return count == 0 ? 0.0f
                    : kRmsSteps / static_cast<float>(std::sqrt(sum / static_cast<double>(count)));
}

std::int16_t rounded(float steps) {
  constexpr auto kMost = static_cast<float>(EdgeImage::kLargestEdge);
  return static_cast<std::int16_t>(std::lround(std::clamp(steps, -kMost, kMost)));
}

}  // namespace

EdgeImage::EdgeImage(const Image2d& image, std::span<const std::uint8_t> used, int border)
    : width_(image.width + 2 * border), height_(image.height + 2 * border), border_(border) {
  const std::vector<float> gradients = compressed_gradients(image, used);
  const float steps = steps_per_unit(gradients);
  const auto width = static_cast<std::size_t>(width_);
  const auto height = static_cast<std::size_t>(height_);
  const auto added = static_cast<std::size_t>(border);
  edges_.assign(2 * width * height + kReadBeyond, 0);
  const std::size_t numbers = 2 * static_cast<std::size_t>(image.width);
  for (std::size_t row = 0; row < static_cast<std::size_t>(image.height); ++row)
    for (std::size_t i = 0; i < numbers; ++i)
      edges_[2 * ((row + added) * width + added) + i] =
          rounded(steps * gradients[row * numbers + i]);

  energy_sums_.assign((width + 1) * (height + 1), 0);
  for (std::size_t row = 0; row < height; ++row)
    for (std::size_t column = 0; column < width; ++column) {
      const std::int64_t x = edges_[2 * (row * width + column)];
      const std::int64_t y = edges_[2 * (row * width + column) + 1];
      const std::size_t at = (row + 1) * (width + 1) + column + 1;
      energy_sums_[at] = x * x + y * y + energy_sums_[at - 1] + energy_sums_[at - width - 1] -
                         energy_sums_[at - width - 2];
    }
}

double EdgeImage::mean_energy() const {
  const double pixels = static_cast<double>(width_ - 2 * border_) * (height_ - 2 * border_);
  return pixels > 0.0 ? static_cast<double>(energy(0, 0, width_, height_)) / pixels : 0.0;
}

std::int64_t EdgeImage::energy(int column, int row, int width, int height) const {
  const auto sum_to = [&](int c, int r) {
    return energy_sums_[static_cast<std::size_t>(r) * static_cast<std::size_t>(width_ + 1) +
                        static_cast<std::size_t>(c)];
  };
  return sum_to(column + width, row + height) - sum_to(column, row + height) -
         sum_to(column + width, row) + sum_to(column, row);
}

namespace {

/// The used pixels of a pattern that has an edge there, for an image whose rows are so far apart.
std::vector<PatternPixel> edge_pixels(const EdgeImage& pattern,
                                      std::span<const std::uint8_t> used,
                                      int image_stride) {
  std::vector<PatternPixel> pixels;
  for (int row = 0; row < pattern.height(); ++row)
    for (int column = 0; column < pattern.width(); ++column) {
      const std::size_t at = static_cast<std::size_t>(row * pattern.width() + column);
      const std::int16_t* const edge = pattern.edges() + 2 * at;
      if ((used.empty() || used[at] != 0) && (edge[0] != 0 || edge[1] != 0))
        pixels.push_back({{edge[0], edge[1]}, row * image_stride + column});
    }
  return pixels;
}

/// Ones at the used pixels of a pattern so wide.
std::vector<PatternPixel> ones(std::span<const std::uint8_t> used, int width, int image_stride) {
  std::vector<PatternPixel> pixels;
  for (std::size_t i = 0; i < used.size(); ++i) {
    const auto at = static_cast<int>(i);
    if (used[i] != 0) pixels.push_back({{1, 1}, at / width * image_stride + at % width});
  }
  return pixels;
}

/// Sums of products with the pairs of an image at every shift of a window, where a pattern of this
/// size must stay within the image.
std::vector<std::int32_t> products(const std::vector<PatternPixel>& pattern,
                                   const std::int16_t* image_pairs,
                                   const EdgeImage& image,
                                   const ShiftWindow& window) {
  std::vector<std::int32_t> sums(window.size());
  const auto kernel = select_kernel<CorrelateEdges>(
      kernels_128::correlate_edges, kernels_256::correlate_edges, kernels_512::correlate_edges);
  kernel(pattern.data(),
         static_cast<std::int32_t>(pattern.size()),
         {image_pairs + 2 * (static_cast<std::ptrdiff_t>(window.first_row) * image.width() +
                             window.first_column),
          image.width()},
         {window.columns, window.rows},
         sums.data());
  return sums;
}

void require_within(const EdgeImage& pattern,
                    const EdgeImage& image,
                    const ShiftWindow& window,
                    std::span<const float> likeness) {
  const auto& [first_column, first_row, columns, rows] = window;
  check(first_column >= 0 && first_row >= 0 &&
            first_column + columns + pattern.width() - 1 <= image.width() &&
            first_row + rows + pattern.height() - 1 <= image.height(),
        "a pattern must stay within the image");
  check(likeness.size() == window.size(), "there is a likeness for every shift");
  check(pattern.width() * pattern.height() <= EdgeImage::kMostPixels,
        "sums of a larger pattern may overflow");
}

/// Share of an image's mean energy that counts where it shows less.
constexpr double kLeastShare = 0.25;

float normalised(std::int32_t product, double of_pattern, double of_image) {
  const double both = of_pattern * of_image;
  return both > 0.0 ? static_cast<float>(static_cast<double>(product) / std::sqrt(both)) : 0.0f;
}

}  // namespace

void correlate(const EdgeImage& pattern,
               const EdgeImage& image,
               const ShiftWindow& window,
               std::span<float> likeness) {
  require_within(pattern, image, window, likeness);
  const int width = pattern.width();
  const int height = pattern.height();
  const std::vector<std::int32_t> alike =
      products(edge_pixels(pattern, {}, image.width()), image.edges(), image, window);
  const double of_pattern = static_cast<double>(pattern.energy(0, 0, width, height));
  const double floor = kLeastShare * image.mean_energy() * width * height;
  for (int row = 0; row < window.rows; ++row)
    for (int column = 0; column < window.columns; ++column) {
      const auto i = static_cast<std::size_t>(row * window.columns + column);
      const double here = static_cast<double>(
          image.energy(window.first_column + column, window.first_row + row, width, height));
      likeness[i] = normalised(alike[i], of_pattern, std::max(here, floor));
    }
}

std::vector<std::int16_t> quarter_squares(const EdgeImage& image) {
  static_assert(EdgeImage::kLargestEdge * EdgeImage::kLargestEdge / 4 <= INT16_MAX);
  std::vector<std::int16_t> squares(image.edge_count() + kReadBeyond);
  std::transform(
      image.edges(), image.edges() + image.edge_count(), squares.begin(), [](std::int16_t edge) {
        return static_cast<std::int16_t>(edge * edge / 4);
      });
  return squares;
}

void correlate_within(std::span<const std::uint8_t> used,
                      const EdgeImage& pattern,
                      const EdgeImage& image,
                      std::span<const std::int16_t> image_squares,
                      const ShiftWindow& window,
                      std::span<float> likeness) {
  require_within(pattern, image, window, likeness);
  check(2 * used.size() == pattern.edge_count(), "a pixel is used or not");
  check(image_squares.size() == image.edge_count() + kReadBeyond, "squares are of this image");
  const std::vector<PatternPixel> edges = edge_pixels(pattern, used, image.width());
  const std::vector<PatternPixel> counted = ones(used, pattern.width(), image.width());
  const std::vector<std::int32_t> alike = products(edges, image.edges(), image, window);
  const std::vector<std::int32_t> energies = products(counted, image_squares.data(), image, window);
  double of_pattern = 0.0;
  for (const PatternPixel& pixel : edges)
    of_pattern += pixel.edge[0] * pixel.edge[0] + pixel.edge[1] * pixel.edge[1];
  const double floor = kLeastShare * image.mean_energy() * static_cast<double>(counted.size());
  for (std::size_t i = 0; i < likeness.size(); ++i)
    likeness[i] =
        normalised(alike[i], of_pattern, std::max(4.0 * static_cast<double>(energies[i]), floor));
}

}  // namespace af::registration
