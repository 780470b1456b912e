// SPDX-License-Identifier: Apache-2.0
#include "register/search/edge_image.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "base/vector_width.h"
#include "unit/register/similarity/noise_image.h"

namespace af::registration {
namespace {

/// Sum of the scalar products of two windows of edges.
double product(const EdgeImage& a,
               int a_column,
               int a_row,
               const EdgeImage& b,
               int b_column,
               int b_row,
               int width,
               int height) {
  double sum = 0.0;
  const auto edge = [](const EdgeImage& image, int column, int row, int part) {
    return static_cast<double>(
        image.edges()[2 * (static_cast<std::ptrdiff_t>(row) * image.width() + column) + part]);
  };
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column)
      for (int part = 0; part < 2; ++part)
        sum += edge(a, a_column + column, a_row + row, part) *
               edge(b, b_column + column, b_row + row, part);
  return sum;
}

TEST(EdgeImage, IsTheGradientOverTheRootOfItsSize) {
  // A ramp along columns, four times as steep in its right half.
  Image2d ramp(9, 5);
  for (int row = 0; row < 5; ++row)
    for (int column = 0; column < 9; ++column)
      ramp.at(column, row) = static_cast<float>(column <= 4 ? column : 4 + 4 * (column - 4));
  const EdgeImage edges(ramp, {}, 0);
  const auto at = [&](int column, int row, int part) {
    return edges.edges()[2 * (row * 9 + column) + part];
  };
  EXPECT_NEAR(at(6, 2, 0), 2.0 * at(2, 2, 0), 1.0);  // the root of four times; rounded
  EXPECT_GT(at(2, 2, 0), 0);
  EXPECT_EQ(at(2, 2, 1), 0);
  EXPECT_EQ(at(0, 2, 0), 0) << "nothing is known beyond the border";
  EXPECT_EQ(at(2, 0, 0), 0);
}

TEST(EdgeImage, HasNoEdgesWhereTheGradientWouldLookAtUnusedPixels) {
  const Image2d image = test::noise_image(12, 10, 1);
  std::vector<std::uint8_t> used(120, 1);
  used[4 * 12 + 5] = 0;
  const EdgeImage edges(image, used, 3);
  EXPECT_EQ(edges.width(), 18);
  EXPECT_EQ(edges.height(), 16);
  for (const auto& [column, row] : {std::pair(4, 4), {6, 4}, {5, 3}, {5, 5}})
    EXPECT_EQ(edges.energy(column + 3, row + 3, 1, 1), 0);
  EXPECT_GT(edges.energy(8 + 3, 4 + 3, 1, 1), 0);
  EXPECT_EQ(edges.energy(0, 0, 18, 3), 0) << "the border";
}

TEST(EdgeImage, OfAConstantImageIsNothing) {
  const EdgeImage edges(Image2d(6, 6), {}, 1);
  EXPECT_EQ(edges.mean_energy(), 0.0);
}

TEST(EdgeCorrelation, IsTheSumOfProductsOnEveryVectorWidth) {
  const EdgeImage image(test::noise_image(40, 31, 2), {}, 4);
  const EdgeImage pattern(test::noise_image(21, 13, 3), {}, 0);
  constexpr int kColumns = 9;
  constexpr int kRows = 7;
  const double of_pattern = static_cast<double>(pattern.energy(0, 0, 21, 13));
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    std::vector<float> likeness(kColumns * kRows);
    correlate(pattern, image, {2, 5, kColumns, kRows}, likeness);
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column) {
        const double floor = 0.25 * image.mean_energy() * 21 * 13;
        const double here = product(image, 2 + column, 5 + row, image, 2 + column, 5 + row, 21, 13);
        const double expected = product(pattern, 0, 0, image, 2 + column, 5 + row, 21, 13) /
                                std::sqrt(of_pattern * std::max(here, floor));
        EXPECT_EQ(likeness[static_cast<std::size_t>(row * kColumns + column)],
                  static_cast<float>(expected));
      }
  }
  force_vector_width(std::nullopt);
}

TEST(EdgeCorrelation, WithinAPartIgnoresWhatIsAroundIt) {
  const EdgeImage image(test::noise_image(70, 40, 5), {}, 2);
  const EdgeImage pattern(test::noise_image(17, 12, 6), {}, 0);
  const std::vector<std::int16_t> squares = quarter_squares(image);
  std::vector<std::uint8_t> used(17 * 12, 0);
  for (int row = 3; row < 9; ++row)
    for (int column = 2; column < 12; ++column)
      used[static_cast<std::size_t>(row * 17 + column)] = 1;
  constexpr int kColumns = 57;  // more than any kernel sums at a time
  constexpr int kRows = 4;
  const double of_pattern = static_cast<double>(pattern.energy(2, 3, 10, 6));
  const double floor = 0.25 * image.mean_energy() * 60;
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    std::vector<float> likeness(kColumns * kRows);
    // The last shift is the last one that the image holds, so that kernels read behind it.
    correlate_within(used, pattern, image, squares, {1, 29, kColumns, kRows}, likeness);
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column) {
        const double both =
            of_pattern *
            std::max(static_cast<double>(image.energy(3 + column, 32 + row, 10, 6)), floor);
        const double expected =
            product(pattern, 2, 3, image, 3 + column, 32 + row, 10, 6) / std::sqrt(both);
        // Quarters of squares are rounded down by at most 3/4, and edges are 51 steps long (RMS).
        EXPECT_NEAR(likeness[static_cast<std::size_t>(row * kColumns + column)], expected, 1e-3);
      }
  }
  force_vector_width(std::nullopt);
}

TEST(EdgeCorrelation, FindsAPatternWhereItWasCutOut) {
  const Image2d image = test::noise_image(50, 44, 4);
  const EdgeImage edges(image, {}, 6);
  const EdgeImage pattern(crop(image, {13, 9, 20, 18}), {}, 0);
  constexpr int kColumns = 30;
  constexpr int kRows = 26;
  std::vector<float> likeness(kColumns * kRows);
  correlate(pattern, edges, {0, 0, kColumns, kRows}, likeness);
  const auto best = std::max_element(likeness.begin(), likeness.end()) - likeness.begin();
  EXPECT_EQ(best % kColumns, 13 + 6);
  EXPECT_EQ(best / kColumns, 9 + 6);
  // The pattern lacks the edges of its border, 72 of 360 pixels.
  EXPECT_GT(*std::max_element(likeness.begin(), likeness.end()), 0.85f);
}

}  // namespace
}  // namespace af::registration
