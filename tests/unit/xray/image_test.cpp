// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "xray/gaussian_blur.h"
#include "xray/image2d.h"
#include "xray/psnr.h"

namespace af {
namespace {

TEST(Psnr, FollowsEquationTwelveWithoutTheBackground) {
  const std::vector<float> reference{0.0f, 0.0f, 4.0f, 2.0f};
  const std::vector<float> drr{
      9.0f, 0.0f, 4.5f, 2.5f};  // the 9 lies on background and must not count
  const auto result = psnr(drr, reference);
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->rms_difference, 0.5, 1e-12);
  EXPECT_NEAR(result->psnr_db, 20 * std::log10(4.0 / 0.5), 1e-12);
  EXPECT_DOUBLE_EQ(result->foreground_fraction, 0.5);
}

TEST(Psnr, IsInfiniteForEqualImagesAndAbsentWithoutForeground) {
  const std::vector<float> image{1.0f, 2.0f};
  EXPECT_EQ(psnr(image, image)->psnr_db, std::numeric_limits<double>::infinity());
  const std::vector<float> empty{0.0f, 0.0f};
  EXPECT_FALSE(psnr(image, empty));
}

TEST(GaussianBlur, KeepsTheSumAndHasTheStatedSpread) {
  Image2d impulse(61, 61);
  impulse.at(30, 30) = 1000.0f;
  const double sigma = 2.5;
  const Image2d blurred = gaussian_blur(impulse, sigma);
  double sum = 0.0;
  double second_moment = 0.0;
  for (int row = 0; row < 61; ++row)
    for (int column = 0; column < 61; ++column) {
      const auto value = static_cast<double>(blurred.at(column, row));
      sum += value;
      second_moment += value * (column - 30) * (column - 30);
    }
  // The kernel is cut at 4 sigma, which removes 1e-3 of the second moment and renormalises.
  EXPECT_NEAR(sum, 1000.0, 1e-2);
  EXPECT_NEAR(second_moment / sum, sigma * sigma, 2e-3 * sigma * sigma);
}

TEST(GaussianBlur, LeavesAConstantImageAndZeroSigmaAlone) {
  Image2d image(9, 7);
  for (float& pixel : image.pixels) pixel = 3.0f;
  for (const float pixel : gaussian_blur(image, 1.7).pixels) EXPECT_NEAR(pixel, 3.0f, 1e-6f);
  image.at(2, 3) = 8.0f;
  EXPECT_EQ(gaussian_blur(image, 0.0).pixels, image.pixels);
}

TEST(RegionOfInterest, MustLieOnTheDetector) {
  EXPECT_TRUE(problems(RegionOfInterest{0, 0, 10, 8}, 10, 8).empty());
  for (const RegionOfInterest& bad : {RegionOfInterest{1, 0, 10, 8},
                                      {0, 1, 10, 8},
                                      {-1, 0, 2, 2},
                                      {0, 0, 0, 3},
                                      {5, 5, std::numeric_limits<int>::max(), 1}})
    EXPECT_EQ(problems(bad, 10, 8).size(), 1u);
}

TEST(Image2d, CropTakesColumnsAndRowsInOrder) {
  Image2d image(4, 3);
  std::iota(image.pixels.begin(), image.pixels.end(), 0.0f);
  EXPECT_EQ(crop(image, {1, 1, 2, 2}).pixels, (std::vector<float>{5, 6, 9, 10}));
}

}  // namespace
}  // namespace af
