// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/line_integrals.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "unit/evaluate/scan/simulated_scan.h"

namespace af {
namespace {

using test::simulated_scan;
using test::small_scan;

/// A tube whose output drifts, a beam that is brighter in its middle, stripes, a dark corner.
struct Detector {
  bool stripes_are_columns;
  double noise = 0.0;

  [[nodiscard]] static bool is_dark(int column, int row) { return column + row < 12; }
  [[nodiscard]] double air(const Image2d& image, int column, int row) const {
    const double x = 2.0 * column / image.width - 1.0;
    const double y = 2.0 * row / image.height - 1.0;
    const double stripe = 1.0 + 0.02 * std::sin(12.3 * (stripes_are_columns ? column : row));
    return 4e4 * (1.0 - 0.1 * x * x - 0.05 * y + 0.02 * x * y * y) * stripe;
  }
  [[nodiscard]] Image2d counts(const Image2d& line_integrals, int view) const {
    Image2d result(line_integrals.width, line_integrals.height);
    const double beam = 1.0 + 0.03 * std::sin(0.5 * view);
    for (int row = 0; row < result.height; ++row)
      for (int column = 0; column < result.width; ++column) {
        const auto pixel = static_cast<std::uint64_t>(row * result.width + column);
        const double grain =
            noise * (HashRandom(7, static_cast<std::uint64_t>(view), pixel).uniform() - 0.5);
        result.at(column, row) = static_cast<float>(
            is_dark(column, row)
                ? 900.0
                : beam * air(result, column, row) *
                      std::exp(-static_cast<double>(line_integrals.at(column, row))) *
                      (1.0 + grain));
      }
    return result;
  }
};

/// Every tenth view, in counts.
std::vector<Image2d> twelve_views(const Detector& detector, const ScanImages& images) {
  std::vector<Image2d> counts;
  for (int view = 0; view < 12; ++view)
    counts.push_back(
        detector.counts(images.line_integrals[static_cast<std::size_t>(10 * view)], view));
  return counts;
}

PixelStatistics statistics_of(const std::vector<Image2d>& counts) {
  std::vector<const Image2d*> all;
  for (const Image2d& image : counts) all.push_back(&image);
  return pixel_statistics(all);
}

class AirLevelAlong : public testing::TestWithParam<AxisAlong> {};
INSTANTIATE_TEST_SUITE_P(Axes, AirLevelAlong, testing::Values(AxisAlong::Columns, AxisAlong::Rows));

TEST_P(AirLevelAlong, IsFoundAroundAnObjectUnderStripesAndDrift) {
  const CircularScan scan = small_scan(GetParam());
  // A ball that covers three quarters of the width in all views, with others in it.
  const ScanImages images =
      simulated_scan(scan, ScanCalibration::nominal(scan), test::lopsided_balls());
  const Detector detector{GetParam() == AxisAlong::Columns, 0.05};
  std::vector<Image2d> counts;
  for (int view = 0; view < 120; ++view)
    counts.push_back(detector.counts(images.line_integrals[static_cast<std::size_t>(view)], view));
  const AirLevel level = estimated_air_level(statistics_of(counts), GetParam());
  double error = 0.0;
  double lit = 0.0;
  for (int view = 0; view < 120; view += 7) {
    const auto i = static_cast<std::size_t>(view);
    const Image2d found = line_integrals_of(counts[i], level, GetParam(), 0.5);
    for (std::size_t pixel = 0; pixel < found.pixels.size(); ++pixel) {
      if (level.is_lit[pixel] == 0) continue;
      error += static_cast<double>(found.pixels[pixel] - images.line_integrals[i].pixels[pixel]);
      lit += 1.0;
    }
  }
  // The mean over the object. Most of its pixels never showed air, so the fit is extrapolated
  // there.
  EXPECT_NEAR(error / lit, 0.0, 0.003);
  EXPECT_EQ(level.is_lit[0], 0) << "the dark corner";
  EXPECT_EQ(level.is_air[static_cast<std::size_t>(30 * scan.size_px.x() + 30)], 0) << "the object";
}

TEST(LineIntegrals, FromAFlatImageAreExact) {
  const CircularScan scan = small_scan();
  const ScanImages images =
      simulated_scan(scan, ScanCalibration::nominal(scan), test::lopsided_balls());
  const Detector detector{true, 0.0};
  const Image2d flat = detector.counts(Image2d(scan.size_px.x(), scan.size_px.y()), 0);
  const std::vector<Image2d> counts = twelve_views(detector, images);
  const AirLevel level = air_level_of_flat(flat, statistics_of(counts));
  const Image2d found = line_integrals_of(counts[5], level, scan.axis_along, 0.5);
  for (int row = 0; row < scan.size_px.y(); ++row)
    for (int column = 0; column < scan.size_px.x(); ++column)
      // Pixels at the ball's rim, a little shadowed, pass as air and lower the beam by a permille.
      EXPECT_NEAR(Detector::is_dark(column, row) ? 0.0F : found.at(column, row),
                  Detector::is_dark(column, row) ? 0.0F : images.line_integrals[50].at(column, row),
                  0.003);
}

TEST(LineIntegrals, FromAFlatOfAnotherExposureAreThoseOfTheObject) {
  const CircularScan scan = small_scan();
  // Beside a ball half as wide as the detector there is air. The ball lies on the axis, so only
  // noise and the tube's drift change pixels from view to view.
  const ScanImages images = simulated_scan(
      scan, ScanCalibration::nominal(scan), {test::Ball{{0.0, 0.0, 0.0}, 8.0, 0.03}});
  const Detector detector{true, 0.02};
  Image2d flat = detector.counts(Image2d(scan.size_px.x(), scan.size_px.y()), 0);
  for (float& value : flat.pixels) value *= 2.0F;
  const std::vector<Image2d> counts = twelve_views(detector, images);
  const AirLevel level = air_level_of_flat(flat, statistics_of(counts));
  EXPECT_NEAR(beam_of(counts[0], level), 0.5, 0.02);
  const Image2d found = line_integrals_of(counts[5], level, scan.axis_along, 0.5);
  EXPECT_NEAR(found.at(36, 30), images.line_integrals[50].at(36, 30), 0.04);
}

TEST(LineIntegrals, OfTransmissionsAreNotCutAtHalfACount) {
  AirLevel level{
      Image2d(20, 20), std::vector<unsigned char>(400, 1), std::vector<unsigned char>(400, 0)};
  std::fill(level.air.pixels.begin(), level.air.pixels.end(), 1.0F);
  EXPECT_NEAR(least_count_of(level), 1e-5, 1e-9);
  Image2d transmission(20, 20);
  std::fill(transmission.pixels.begin(), transmission.pixels.end(), std::exp(-6.0F));
  EXPECT_NEAR(
      line_integrals_of(transmission, level, AxisAlong::Rows, least_count_of(level)).at(3, 3),
      6.0F,
      1e-4F);
  std::fill(level.air.pixels.begin(), level.air.pixels.end(), 255.0F);
  EXPECT_EQ(least_count_of(level), 0.5);
}

TEST(LineIntegrals, OfAnObjectBeyondTheDetectorAreThoseOfTheFlat) {
  Image2d flat(40, 40);
  std::fill(flat.pixels.begin(), flat.pixels.end(), 1000.0F);
  // A body that is thinnest in the middle of the detector and covers all of it.
  Image2d shadowed = flat;
  const auto body = [](int column) {
    const double x = (column - 19.5) / 20.0;
    return 0.7 + 0.5 * x * x;
  };
  for (int row = 0; row < 40; ++row)
    for (int column = 0; column < 40; ++column)
      shadowed.at(column, row) *= static_cast<float>(std::exp(-body(column)));
  const AirLevel level = air_level_of_flat(flat, pixel_statistics({&shadowed}));
  EXPECT_NEAR(level.brightest_share, std::exp(-0.7), 0.01);
  const Image2d found = line_integrals_of(shadowed, level, AxisAlong::Rows, 0.5);
  for (int row = 0; row < 40; ++row)
    for (int column = 0; column < 40; ++column)
      EXPECT_NEAR(static_cast<double>(found.at(column, row)), body(column), 1e-5);
}

TEST(AirLevel, IsRefusedWhereOneSideIsInShadow) {
  Image2d mean(40, 40);
  const Image2d deviation(40, 40);
  for (int row = 0; row < 40; ++row)
    for (int column = 0; column < 40; ++column)
      mean.at(column, row) = column < 12 ? 400.0F : 1000.0F;
  EXPECT_NO_THROW(estimated_air_level({mean, deviation}, AxisAlong::Columns));
  EXPECT_THROW(estimated_air_level({mean, deviation}, AxisAlong::Rows), InputError);
}

TEST(AirLevel, IsRefusedWhereNoAirIsSeen) {
  Image2d mean(40, 40);
  Image2d deviation(40, 40);
  for (std::size_t i = 0; i < mean.pixels.size(); ++i) {
    mean.pixels[i] = 1000.0F;
    deviation.pixels[i] = i % 3 == 0 ? 1.0F : 500.0F;
  }
  mean.pixels[0] = 1e9F;  // one bright pixel: all others are behind an aperture
  for (std::size_t i = 1; i < 20; ++i) mean.pixels[i] = 1e9F;
  EXPECT_THROW(estimated_air_level({mean, deviation}, AxisAlong::Rows), InputError);
}

}  // namespace
}  // namespace af
