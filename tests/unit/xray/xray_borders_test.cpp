// SPDX-License-Identifier: Apache-2.0
#include "xray/xray_borders.h"

#include <cmath>
#include <functional>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "xray/air_level.h"
#include "xray/quantile.h"

namespace af {
namespace {

using testing::HasSubstr;

constexpr double kAirLevel = 4000.0;
constexpr auto kAir = static_cast<float>(kAirLevel);
constexpr float kShutter = 40.0f;
constexpr float kBody = 300.0f;

/// Air with 1 % of noise, and what `value` puts into it where it is not negative.
Image2d picture(int width, int height, const std::function<float(int, int)>& value) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0.0f, 1.0f);
  Image2d image(width, height);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const float put = value(column, row);
      const float level = put < 0.0f ? kAir : put;
      image.at(column, row) = std::round(level * (1.0f + 0.01f * noise(random)));
    }
  return image;
}

/// A body with soft sides that crosses the picture from top to bottom.
float body(int column, int width) {
  const double depth = 1.0 - std::pow((column - 0.5 * width) / (0.25 * width), 2);
  return depth <= 0.0 ? -1.0f : kAir * static_cast<float>(std::exp(-2.6 * std::sqrt(depth)));
}

TEST(XrayBorders, LeaveAPictureWithoutBordersWhole) {
  EXPECT_FALSE(find_xray_borders(picture(160, 120, [](int, int) { return -1.0f; })).is_any());
  const XrayBorders found =
      find_xray_borders(picture(160, 120, [](int c, int) { return body(c, 160); }));
  EXPECT_EQ(found.masked_share(), 0.0) << found.text();
}

TEST(XrayBorders, MaskFourBladesAndKeepTheBodyThatPassesBehindThem) {
  const auto is_shut = [](int c, int r) { return c < 20 || c >= 150 || r < 12 || r >= 100; };
  const XrayBorders found = find_xray_borders(
      picture(160, 120, [&](int c, int r) { return is_shut(c, r) ? kShutter : body(c, 160); }));
  EXPECT_EQ(found.straight_sides, 4) << found.text();
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) {
      const bool is_used = found.mask.at(column, row) != 0.0f;
      if (is_shut(column, row)) {
        ASSERT_FALSE(is_used) << column << " " << row;
      }
      const int m = found.margin_px + 2;  // the edge is found to one or two pixels
      if (!is_shut(column - m, row - m) && !is_shut(column + m, row + m)) {
        ASSERT_TRUE(is_used) << column << " " << row;
      }
    }
}

TEST(XrayBorders, FindTheCircleOfAnAperture) {
  // A penumbra of 6 px about a radius of 90.
  const auto share = [](int c, int r) {
    return std::clamp((93.0 - std::hypot(c - 105.0, r - 98.0)) / 6.0, 0.0, 1.0);
  };
  const XrayBorders found = find_xray_borders(picture(210, 200, [&](int c, int r) {
    const float inside = body(c, 210) < 0.0f ? kAir : body(c, 210);
    return kShutter + static_cast<float>(share(c, r)) * (inside - kShutter);
  }));
  ASSERT_TRUE(found.circle) << found.text();
  EXPECT_NEAR(found.circle->column_px, 105.0, 2.0);
  EXPECT_NEAR(found.circle->row_px, 98.0, 2.0);
  EXPECT_NEAR(found.circle->radius_px, 92.0, 4.0);  // where it is 15 % bright
  EXPECT_LE(found.margin_px, 14) << "6 px of penumbra, and the body in every ring";
  for (int row = 0; row < 200; ++row)
    for (int column = 0; column < 210; ++column) {
      if (share(column, row) < 0.5) {
        ASSERT_EQ(found.mask.at(column, row), 0.0f) << column << " " << row;
      }
      if (std::hypot(column - 105.0, row - 98.0) < 90.0 - found.margin_px) {
        ASSERT_NE(found.mask.at(column, row), 0.0f) << column << " " << row;
      }
    }
}

TEST(XrayBorders, MaskDeadRowsAndColumnsOfAnyValue) {
  const XrayBorders found = find_xray_borders(picture(100, 80, [](int, int) { return -1.0f; }));
  ASSERT_FALSE(found.is_any());
  Image2d image = picture(100, 80, [](int, int) { return -1.0f; });
  for (int row = 0; row < 80; ++row)
    for (int column = 0; column < 100; ++column)
      if (column < 3 || row >= 75) image.at(column, row) = column < 3 ? 65535.0f : 0.0f;
  // Rows are looked at first; they must be constant over their whole length.
  for (int row = 75; row < 80; ++row)
    for (int column = 0; column < 3; ++column) image.at(column, row) = 0.0f;
  const XrayBorders dead = find_xray_borders(image);
  EXPECT_EQ(dead.dead_px, (std::array<int, 4>{3, 0, 0, 5})) << dead.text();
  EXPECT_EQ(dead.mask.at(2, 10), 0.0f);
  EXPECT_NE(dead.mask.at(3, 10), 0.0f);
  EXPECT_EQ(dead.mask.at(50, 75), 0.0f);
  EXPECT_NE(dead.mask.at(50, 74), 0.0f);
}

TEST(XrayBorders, MaskMetalAtTheEdgeButNotDarkAnatomyThatLeavesThePicture) {
  const auto is_metal = [](int c, int r) { return c >= 150 && r >= 50 && r < 62; };
  const auto is_limb = [](int c, int r) { return r >= 70 && c >= 40 && c < 90; };
  const XrayBorders found = find_xray_borders(picture(160, 120, [&](int c, int r) {
    return is_metal(c, r) ? kShutter : is_limb(c, r) ? kBody + 350.0f : -1.0f;
  }));
  EXPECT_GT(found.opaque_share, 0.0);
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) {
      if (is_metal(column, row)) {
        ASSERT_EQ(found.mask.at(column, row), 0.0f);
      }
      if (is_limb(column, row)) {
        ASSERT_NE(found.mask.at(column, row), 0.0f);
      }
    }
}

/// A body that fills the picture except for a bright middle. It grows dark towards the corners,
/// without an edge.
TEST(XrayBorders, AreNotDarkAnatomyThatFillsTheCorners) {
  const XrayBorders found = find_xray_borders(picture(160, 120, [](int c, int r) {
    const double away = std::hypot((c - 80) / 80.0, (r - 60) / 60.0);
    return kAir * static_cast<float>(std::exp(-0.3 - 3.2 * away * away));
  }));
  EXPECT_FALSE(found.is_any()) << found.text();
  EXPECT_THAT(found.text(), HasSubstr("may be anatomy"));
}

/// A circle fitted to a rounded corner would hide most of the picture.
TEST(XrayBorders, TakeNoCircleForTheArcOfACorner) {
  const XrayBorders found = find_xray_borders(picture(160, 120, [](int c, int r) {
    return c < 30 && r < 30 && std::hypot(c - 30, r - 30) > 30 ? kShutter : -1.0f;
  }));
  EXPECT_FALSE(found.circle.has_value()) << found.text();
  EXPECT_LT(found.masked_share(), 0.1) << found.text();
}

TEST(XrayBorders, SayTheyAreInDoubtRatherThanMaskMostOfAPicture) {
  const XrayBorders found =
      find_xray_borders(picture(160, 120, [](int c, int) { return c < 20 ? -1.0f : kBody; }));
  EXPECT_FALSE(found.is_any());
  EXPECT_THAT(found.text(), HasSubstr("may be anatomy"));
}

TEST(AirLevel, OfTheOpenBeamIsTheBrightestPeakAndNotTheBrightestPixels) {
  Image2d image = picture(160, 120, [](int c, int) { return body(c, 160); });
  for (int i = 0; i < 100; ++i) image.pixels[static_cast<std::size_t>(i)] = 60000.0f;  // 0.5 %
  const auto found = open_beam_peak(image.pixels);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->level, kAirLevel, 0.005 * kAirLevel);  // the median of noise of 1 %
  EXPECT_GT(static_cast<double>(nearest_rank(image.pixels, 0.999)), 2.0 * kAirLevel)
      << "the percentile is misled";
}

TEST(AirLevel, IsNotFoundWhereValuesAreSpreadEvenly) {
  std::vector<float> values;
  for (int i = 0; i < 40000; ++i) values.push_back(std::exp(1e-4f * static_cast<float>(i)) * 50.0f);
  // exp(4) in 40000 steps: 20 % about a value hold 5 %.
  ASSERT_TRUE(open_beam_peak(values));
  values.clear();
  for (int i = 0; i < 40000; ++i) values.push_back(std::exp(2e-4f * static_cast<float>(i)));
  EXPECT_FALSE(open_beam_peak(values));
  EXPECT_FALSE(open_beam_peak({}));
  EXPECT_FALSE(open_beam_peak({0.0f, 0.0f}));
}

TEST(AirLevel, BesideTheCollimatedEdgeIsAirThoughTheMiddleIsNot) {
  const Image2d image = picture(160, 120, [](int c, int r) {
    if (c < 20 || c >= 140 || r < 15 || r >= 105) return kShutter;
    return std::hypot(c - 80, r - 60) < 34 ? kBody : -1.0f;
  });
  const XrayBorders borders = find_xray_borders(image);
  ASSERT_TRUE(borders.is_any());
  EXPECT_NEAR(air_beside_edge(image, borders.mask).level, kAirLevel, 0.02 * kAirLevel);
}

TEST(AirBesideEdge, IsNoneWhereEverythingIsHidden) {
  EXPECT_EQ(air_beside_edge(picture(20, 20, [](int, int) { return -1.0f; }), Image2d(20, 20)).level,
            0.0);
}

TEST(Background, IsBrightDarkOrUndecidedByThePictureItself) {
  Image2d image = picture(
      100, 100, [](int c, int r) { return std::hypot(c - 50, r - 50) < 30 ? kBody : -1.0f; });
  EXPECT_EQ(background_of(image, {}), Background::Bright);
  for (float& value : image.pixels) value = 4095.0f - value;
  EXPECT_EQ(background_of(image, {}), Background::Dark);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<float>(i % 100);
  EXPECT_EQ(background_of(image, {}), Background::Undecided);
}

/// A body that fills the picture, with photon noise: 8 units of attenuation at the edge, 3 in the
/// middle, and bones; or air about a body.
Image2d photons(bool is_full) {
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0.0f, 1.0f);
  Image2d image(160, 160);
  for (int row = 0; row < 160; ++row)
    for (int column = 0; column < 160; ++column) {
      const double radius = std::hypot(column - 80, row - 80) / 80.0;
      double depth = is_full ? 1.0 + 2.5 * std::min(radius, 1.4)
                             : 3.0 * std::sqrt(std::max(0.0, 1.0 - 2.0 * radius * radius));
      if (column / 12 % 4 == 0 && depth > 0.0) depth += 0.4;
      const auto mean = static_cast<float>(4000.0 * std::exp(-depth));
      image.at(column, row) = std::round(mean + 0.5f * std::sqrt(mean) * noise(random));
    }
  return image;
}

TEST(BrightDetail, TellsAnatomyThatFillsThePictureFromANegative) {
  const Image2d full = photons(true);
  EXPECT_EQ(background_of(full, {}), Background::Dark);
  EXPECT_GT(bright_detail(full, {}), 0.5);
  Image2d negative = photons(false);
  EXPECT_GT(bright_detail(negative, {}), 0.5);
  for (float& value : negative.pixels) value = 4095.0f - value;
  EXPECT_EQ(background_of(negative, {}), Background::Dark);
  EXPECT_LT(bright_detail(negative, {}), -0.5);
}

TEST(BrightDetail, LeavesOutWhatIsClippedOrMasked) {
  Image2d image = photons(false);
  const double whole = bright_detail(image, {});
  // Half of the air saturates: what is left of it is as noisy as before.
  for (float& value : image.pixels) value = std::min(value, 4000.0f);
  EXPECT_GT(bright_detail(image, {}), 0.5);
  EXPECT_GT(whole, 0.5);
  // A border with noise of its own, of any size.
  Image2d mask(160, 160);
  for (int row = 20; row < 140; ++row)
    for (int column = 0; column < 160; ++column) mask.at(column, row) = 1.0f;
  const double within = bright_detail(image, mask);
  for (int row = 0; row < 20; ++row)
    for (int column = 0; column < 160; ++column)
      image.at(column, row) = (column + row) % 2 == 0 ? 900.0f : 10.0f;
  EXPECT_LT(bright_detail(image, {}), within - 0.5);
  for (int column = 0; column < 160; ++column) image.at(column, 19) = 10.0f;
  EXPECT_GT(bright_detail(image, mask), 0.5);
  EXPECT_EQ(bright_detail(Image2d(2, 2), {}), 0.0);
  EXPECT_EQ(bright_detail(Image2d(9, 9), {}), 0.0) << "nothing but one value";
}

TEST(FlatCorrected, IsTheShareOfTheBeamAndZeroWhereThereIsNone) {
  Image2d image(3, 1);
  Image2d flat(3, 1);
  Image2d dark(3, 1);
  image.pixels = {60.0f, 110.0f, 10.0f};
  flat.pixels = {110.0f, 210.0f, 10.0f};
  dark.pixels = {10.0f, 10.0f, 10.0f};
  EXPECT_EQ(flat_corrected(image, flat, dark).pixels, (std::vector<float>{0.5f, 0.5f, 0.0f}));
  EXPECT_FLOAT_EQ(flat_corrected(image, flat, {}).pixels[0], 60.0f / 110.0f);
}

}  // namespace
}  // namespace af
