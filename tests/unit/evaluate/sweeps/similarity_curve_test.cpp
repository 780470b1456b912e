// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/similarity_curve.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"

namespace af::evaluation {
namespace {

constexpr double kCurveRounding = 1e-12;

TEST(CurveOffsets, AreSymmetricAboutAnExactZero) {
  const std::vector<double> offsets = curve_offsets(0.5, 0.1);
  ASSERT_EQ(offsets.size(), 11u);
  EXPECT_EQ(offsets[5], 0.0);
  EXPECT_EQ(offsets.front(), -offsets.back());
  EXPECT_NEAR(offsets.back(), 0.5, kCurveRounding);
}

TEST(AlongAxis, SetsOneParameter) {
  EXPECT_NEAR(along_axis(1, 90.0).rotation_rad.y(), std::acos(0.0), kCurveRounding);
  EXPECT_EQ(along_axis(1, 90.0).translation_mm.norm(), 0.0);
  EXPECT_EQ(along_axis(5, -2.0).translation_mm.z(), -2.0);
}

TEST(CurvePeak, OfAParabolaIsItsVertex) {
  // 4 - (x - 0.23)^2 on a grid of 0.5: the parabola through three points is the curve itself.
  const std::vector<double> offsets = curve_offsets(3.0, 0.5);
  std::vector<double> values;
  for (const double x : offsets) values.push_back(4.0 - (x - 0.23) * (x - 0.23));
  const CurvePeak peak = find_peak(offsets, values, 0.0);
  EXPECT_NEAR(peak.offset, 0.23, kCurveRounding);
  EXPECT_FALSE(peak.is_at_edge);
  EXPECT_NEAR(peak.similarity, 4.0 - 0.23 * 0.23, kCurveRounding);
}

TEST(CurvePeak, WidthIsReadAtHalfHeightAboveTheBase) {
  // A tent of height 2 and half base 2 over a base of 1: half height 2 at +-1.
  const std::vector<double> offsets = {-3, -2, -1.5, 0, 1.5, 2, 3};
  const std::vector<double> values = {1, 1, 1.5, 3, 1.5, 1, 1};
  EXPECT_NEAR(find_peak(offsets, values, 1.0).width, 2.0, kCurveRounding);
  // Above a base of 2.5 half height is 2.75, which the lines beside the peak reach at +-0.25.
  EXPECT_NEAR(find_peak(offsets, values, 2.5).width, 0.5, kCurveRounding);
}

TEST(CurvePeak, SaysWhenItLeavesTheWindow) {
  const std::vector<double> offsets = {-1, 0, 1};
  const CurvePeak rising = find_peak(offsets, std::vector<double>{1, 2, 3}, 0.0);
  EXPECT_TRUE(rising.is_at_edge);
  EXPECT_EQ(rising.offset, 1.0);
  EXPECT_TRUE(std::isnan(rising.width));
}

TEST(CurvePeak, TreatsPosesOutsideTheFieldAsHoles) {
  const double nan = std::nan("");
  const std::vector<double> offsets = {-2, -1, 0, 1, 2};
  const CurvePeak peak = find_peak(offsets, std::vector<double>{nan, nan, 2, 0, nan}, 0.0);
  EXPECT_EQ(peak.offset, 0.0);
  EXPECT_TRUE(std::isnan(peak.width));
  EXPECT_THROW(find_peak(offsets, std::vector<double>(5, nan), 0.0), InputError);
}

}  // namespace
}  // namespace af::evaluation
