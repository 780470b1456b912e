// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/self_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "evaluate/scan/image_sampling.h"
#include "unit/evaluate/scan/calibration_distance.h"
#include "unit/evaluate/scan/simulated_scan.h"

namespace af {
namespace {

using test::ball_image;
using test::calibration_distance_px;
using test::lopsided_balls;
using test::simulated_scan;
using test::small_scan;

SelfCalibrationOptions quick_options() {
  SelfCalibrationOptions options;
  options.harmonics = 2;
  options.rounds = 5;
  options.working_px = 72;
  options.search_px = 36;
  options.coarse_px = 4.0;
  // Projections hardly tell the distance: the search may end at its limit.
  options.focal_share = 0.02;
  options.tilt_deg = 0.0;
  return options;
}

/// A detector off its place and farther away than stated. The beam's foot and the rotation wobble
/// and drift.
ScanCalibration wobbling(const CircularScan& scan) {
  ScanCalibration truth = ScanCalibration::nominal(scan, {2, sweep_of(scan)});
  truth.source_to_detector_mm *= 1.02;
  truth.column_px.coefficients << 38.0, 0.3, -0.2, 0.4, 0.3, 0.5;
  truth.row_px.coefficients << 29.0, -0.3, 0.4, 0.3, -0.4, -0.4;
  truth.rotation_rad.coefficients << 0.015, 0.002, -0.001, 0.003, 0.002, 0.001;
  return truth;
}

TEST(SelfCalibration, FindsAKnownWobbleFromEvenViewsForOddOnes) {
  const CircularScan scan = small_scan();
  const ScanCalibration truth = wobbling(scan);
  const ScanImages images = simulated_scan(scan, truth, lopsided_balls());
  ThreadPool pool(2);
  const std::vector<int> even = CircularScan::every(0, 2, 120);
  const std::vector<int> odd = CircularScan::every(1, 2, 120);
  const SelfCalibrationOptions options = quick_options();
  const ScanCalibration stated = ScanCalibration::nominal(scan, {2, sweep_of(scan)});
  const ScanCalibration found = self_calibrate(images, even, options, pool, [](const auto&) {});
  // A pixel is 0.6 mm at the axis, and 60 views 6 degrees apart leave streaks: a tenth of a pixel.
  const double before = calibration_distance_px(scan, truth, stated, 10.0, 10.0);
  const double after = calibration_distance_px(scan, truth, found, 10.0, 10.0);
  EXPECT_GT(before, 0.5);
  EXPECT_LT(after, 0.1);
  // The drift is found as such: 0.5 and -0.4 px.
  EXPECT_NEAR(found.column_px.coefficients[5], truth.column_px.coefficients[5], 0.1);
  EXPECT_NEAR(found.row_px.coefficients[5], truth.row_px.coefficients[5], 0.1);
  const double held_out = held_out_residual(images, found, even, odd, options, pool).rms_px;
  EXPECT_LT(held_out, 0.05);
  // A wrong geometry shows, although the reconstruction adapts to it. Half of its 0.35 px remain.
  ScanCalibration wrong = found;
  wrong.column_px.coefficients[3] += 0.5;
  EXPECT_GT(held_out_residual(images, wrong, even, odd, options, pool).rms_px, 0.15);
}

TEST(SelfCalibration, FollowsWhatItsViewsCanTell) {
  CircularScan scan = small_scan();
  SelfCalibrationOptions options;
  EXPECT_EQ(options.basis_for(scan, 180).harmonics, 8);
  EXPECT_EQ(options.basis_for(scan, 30).harmonics, 3);
  EXPECT_EQ(options.basis_for(scan, 7).harmonics, 0);
  EXPECT_EQ(options.basis_for(scan, 30).size(), 8);
  std::swap(scan.angles_rad[3], scan.angles_rad[90]);  // views whose angles do not tell time
  EXPECT_EQ(options.basis_for(scan, 30).size(), 7);
}

TEST(SelfCalibration, RefusesAScanThatTurnsTheOtherWay) {
  const CircularScan scan = small_scan();
  ScanImages images = simulated_scan(scan, ScanCalibration::nominal(scan), lopsided_balls());
  images.scan = small_scan(AxisAlong::Rows, -3.0);
  ThreadPool pool(2);
  SelfCalibrationOptions options = quick_options();
  options.harmonics = 0;
  try {
    self_calibrate(images, CircularScan::every(0, 2, 120), options, pool, [](const auto&) {});
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("change the sign of step_deg"));
  }
}

/// A rod about the axis looks alike from either side: noise must not decide.
TEST(SelfCalibration, TakesTheStatedDirectionWhereImagesTellNone) {
  const ScanCalibration truth = ScanCalibration::nominal(small_scan());
  std::vector<test::Ball> rod;
  for (int i = -3; i <= 3; ++i) rod.push_back({{0.0, 0.0, 4.0 * i}, 6.0, 0.02});
  const ScanImages images = simulated_scan(small_scan(), truth, rod);
  ThreadPool pool(2);
  SelfCalibrationOptions options = quick_options();
  options.harmonics = 0;
  for (const double step_deg : {3.0, -3.0}) {
    ScanImages turning = images;
    turning.scan = small_scan(AxisAlong::Rows, step_deg);
    std::string lines;
    self_calibrate(
        turning, CircularScan::every(0, 2, 120), options, pool, [&](const std::string& line) {
          lines += line + "\n";
        });
    EXPECT_THAT(lines, testing::HasSubstr("hardly tell which way the scan turns")) << step_deg;
  }
}

TEST(SelfCalibration, RefusesAScanOfNothing) {
  const CircularScan scan = small_scan();
  const ScanImages images = simulated_scan(scan, ScanCalibration::nominal(scan), {});
  ThreadPool pool(1);
  EXPECT_THROW(
      self_calibrate(
          images, CircularScan::every(0, 2, 120), quick_options(), pool, [](const auto&) {}),
      InputError);
}

TEST(ViewAlignment, FindsAKnownMotion) {
  const CircularScan scan = small_scan();
  const ScanCalibration here = ScanCalibration::nominal(scan);
  ScanCalibration there = here;
  there.column_px.coefficients[0] += 0.2;
  there.row_px.coefficients[0] -= 0.1;
  there.rotation_rad.coefficients[0] += 0.01;
  const std::vector<unsigned char> all(static_cast<std::size_t>(scan.size_px.prod()), 1);
  const BandPass band_pass(scan.size_px.x(), scan.size_px.y(), all, 1.0, 4.0);
  const auto image = [&](const ScanCalibration& calibration) {
    return band_pass(ball_image(scan_camera(scan, calibration, 0.3), lopsided_balls()));
  };
  Image2d measured = image(there);
  for (float& value : measured.pixels) value *= 1.3F;  // the gain is eliminated
  measured.at(20, 20) = 10.0F;                         // a stray object hardly counts
  const ViewAlignment alignment = align_view(measured,
                                             image(here),
                                             all,
                                             {here.column_px.at(0.3), here.row_px.at(0.3)},
                                             scan.pixel_spacing_mm);
  const ViewVector step = alignment.normal.ldlt().solve(alignment.right);
  // One step of Gauss-Newton over a shift of a fifth of a pixel.
  EXPECT_NEAR(step[0], 0.2, 0.02);
  EXPECT_NEAR(step[1], -0.1, 0.02);
  EXPECT_NEAR(step[2], 0.01, 0.001);
  EXPECT_NEAR(alignment.gain, 1.3, 0.05);
}

/// A blurred prediction leaves a small residual; an object that has moved away leaves a large one.
TEST(ViewAlignment, ResidualsTellWhatMovedFromWhatIsPredictedRoughly) {
  const CircularScan scan = small_scan();
  const ScanCalibration here = ScanCalibration::nominal(scan);
  const std::vector<unsigned char> all(static_cast<std::size_t>(scan.size_px.prod()), 1);
  const BandPass band_pass(scan.size_px.x(), scan.size_px.y(), all, 1.0, 4.0);
  const CameraGeometry camera = scan_camera(scan, here, 0.3);
  const test::Ball bone{{-9.0, 0.0, 0.0}, 6.0, 0.05};
  const test::Ball moving{{9.0, 0.0, 5.0}, 2.0, 0.05};
  // The bone's prediction is 7 % too weak; air and noise are those of a long exposure.
  test::Ball predicted_bone = bone;
  predicted_bone.mu_per_mm *= 0.93;
  Image2d measured = ball_image(camera, {bone, moving});
  for (std::size_t i = 0; i < measured.pixels.size(); ++i)
    measured.pixels[i] += 1e-4F * static_cast<float>(std::sin(1e4 * static_cast<double>(i * i)));
  const ViewAlignment alignment = align_view(band_pass(measured),
                                             band_pass(ball_image(camera, {predicted_bone})),
                                             all,
                                             {here.column_px.at(0.3), here.row_px.at(0.3)},
                                             scan.pixel_spacing_mm);
  const auto largest_around = [&](const test::Ball& ball) {
    const Eigen::Vector2d pixel = camera.project(ball.center_mm);
    const double radius = 1.6 * ball.radius_mm / scan.pixel_spacing_mm.x() + 2.0;
    double largest = 0.0;
    for (int row = 0; row < scan.size_px.y(); ++row)
      for (int column = 0; column < scan.size_px.x(); ++column)
        if ((Eigen::Vector2d(column, row) - pixel).norm() < radius)
          largest = std::max(
              largest,
              std::abs(static_cast<double>(
                  alignment.residual[static_cast<std::size_t>(row * scan.size_px.x() + column)])));
    return largest;
  };
  EXPECT_LT(largest_around(bone), 6.0);
  EXPECT_GT(largest_around(moving), 6.0);
}

TEST(ViewAlignment, SaysHowMuchOfAShiftNoiseOfThePredictionLetsThrough) {
  const CircularScan scan = small_scan();
  const ScanCalibration here = ScanCalibration::nominal(scan);
  ScanCalibration there = here;
  there.column_px.coefficients[0] += 0.2;
  const std::vector<unsigned char> all(static_cast<std::size_t>(scan.size_px.prod()), 1);
  const BandPass band_pass(scan.size_px.x(), scan.size_px.y(), all, 1.0, 4.0);
  Image2d predicted = ball_image(scan_camera(scan, here, 0.3), lopsided_balls());
  // Noise like that of a reconstruction from few views; any fixed pattern does.
  for (std::size_t i = 0; i < predicted.pixels.size(); ++i)
    predicted.pixels[i] += 0.06F * static_cast<float>(std::sin(1e4 * static_cast<double>(i * i)));
  const ViewAlignment alignment =
      align_view(band_pass(ball_image(scan_camera(scan, there, 0.3), lopsided_balls())),
                 band_pass(predicted),
                 all,
                 {here.column_px.at(0.3), here.row_px.at(0.3)},
                 scan.pixel_spacing_mm);
  EXPECT_LT(alignment.response.x(), 0.95);
  EXPECT_NEAR(alignment.shift_px.x() / alignment.response.x(), 0.2, 0.04);
}

TEST(BandPass, LeavesOutInvalidPixels) {
  Image2d image(20, 20);
  std::vector<unsigned char> is_valid(400, 1);
  for (std::size_t i = 0; i < 400; ++i) image.pixels[i] = 3.0F;
  image.at(7, 9) = 1e6F;
  is_valid[9 * 20 + 7] = 0;
  for (const float value : BandPass(20, 20, is_valid, 1.0, 4.0)(image).pixels)
    EXPECT_NEAR(value, 0.0F, 1e-5F);
}

TEST(SampledCubic, GivesBackParabolasAndPixels) {
  Image2d image(8, 8);
  const auto f = [](double c, double r) { return 1.0 + 0.5 * c - r + 0.25 * c * c - 0.5 * c * r; };
  for (int row = 0; row < 8; ++row)
    for (int column = 0; column < 8; ++column)
      image.at(column, row) = static_cast<float>(f(column, row));
  EXPECT_EQ(sampled_cubic(image, 3.0, 4.0), static_cast<double>(image.at(3, 4)));
  EXPECT_NEAR(sampled_cubic(image, 3.3, 4.6), f(3.3, 4.6), 1e-5);
}

}  // namespace
}  // namespace af
