// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/cross_correlation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "unit/register/similarity/noise_image.h"

namespace af::registration {
namespace {

/// The reference is stored as floats: relative error 6e-8 per pixel, random in sign.
constexpr double kFloatRounding = 1e-6;

double correlation(const SimilarityReference& reference, const std::vector<float>& drr) {
  const CrossCorrelation measure(reference);
  const auto workspace = measure.make_workspace();
  return measure.evaluate(drr, *workspace);
}

TEST(CrossCorrelation, IsOneForAnyRisingLinearMap) {
  const Image2d xray = test::noise_image(23, 19, 1);
  std::vector<float> drr = xray.pixels;
  for (float& value : drr) value = 3.0f * value + 0.5f;
  EXPECT_NEAR(correlation({xray, {}, {0.0, 13.0}}, drr), 1.0, kFloatRounding);
  for (float& value : drr) value = -value;
  EXPECT_NEAR(correlation({xray, {}, {0.0, 13.0}}, drr), -1.0, kFloatRounding);
}

TEST(CrossCorrelation, IsZeroForOrthogonalAndConstantImages) {
  Image2d xray(2, 2);
  xray.pixels = {0.0f, 1.0f, 0.0f, 1.0f};
  EXPECT_NEAR(correlation({xray, {}, {0.0, 1.0}}, {0.0f, 0.0f, 1.0f, 1.0f}), 0.0, kFloatRounding);
  EXPECT_EQ(correlation({xray, {}, {0.0, 1.0}}, {0.3f, 0.3f, 0.3f, 0.3f}), 0.0);
}

TEST(CrossCorrelation, OfAHandComputedTableIsItsClosedForm) {
  // x - mean = -1.5 -0.5 0.5 1.5, d - mean = -1 0 -1 2: 4 / sqrt(5 * 6).
  Image2d xray(4, 1);
  xray.pixels = {0.0f, 1.0f, 2.0f, 3.0f};
  EXPECT_NEAR(correlation({xray, {}, {0.0, 4.0}}, {1.0f, 2.0f, 1.0f, 4.0f}),
              4.0 / std::sqrt(30.0),
              kFloatRounding);
}

TEST(CrossCorrelation, IgnoresPixelsOutsideTheMask) {
  const Image2d xray = test::noise_image(10, 10, 2);
  std::vector<float> drr = test::noise_image(10, 10, 3).pixels;
  SimilarityReference reference{xray, std::vector<std::uint8_t>(100, 1), {0.0, 4.0}};
  for (std::size_t i = 50; i < 100; ++i) reference.used[i] = 0;
  const double expected = correlation(reference, drr);
  for (std::size_t i = 50; i < 100; ++i) drr[i] = 77.0f;
  EXPECT_EQ(correlation(reference, drr), expected);
  drr.resize(50);
  EXPECT_NEAR(
      correlation({crop(xray, {0, 0, 10, 5}), {}, {0.0, 4.0}}, drr), expected, kFloatRounding);
}

}  // namespace
}  // namespace af::registration
