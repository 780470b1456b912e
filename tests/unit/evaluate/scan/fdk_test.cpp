// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/fdk.h"

#include <gtest/gtest.h>

#include "unit/evaluate/scan/simulated_scan.h"

namespace af {
namespace {

using test::Ball;
using test::simulated_scan;
using test::small_scan;

float value_at(const MuVolume& volume, const Eigen::Vector3d& point_mm) {
  const Eigen::Vector3d index = volume.grid.index_of(point_mm);
  const auto at = [&](int axis) { return static_cast<std::size_t>(std::lround(index[axis])); };
  const auto size = [&](int axis) {
    return static_cast<std::size_t>(volume.grid.size[static_cast<std::size_t>(axis)]);
  };
  return volume.mu_per_mm[(at(2) * size(1) + at(1)) * size(0) + at(0)];
}

class FdkAlong : public testing::TestWithParam<AxisAlong> {};
INSTANTIATE_TEST_SUITE_P(Axes, FdkAlong, testing::Values(AxisAlong::Columns, AxisAlong::Rows));

TEST_P(FdkAlong, OfABallGivesItsAttenuationWhereItIs) {
  const CircularScan scan = small_scan(GetParam());
  // The camera states a detector off its place, turned and tilted.
  ScanCalibration truth = ScanCalibration::nominal(scan, {1, sweep_of(scan)});
  truth.column_px.coefficients << 32.0, 1.0, -2.0, 0.5;
  truth.row_px.coefficients << 31.0, -1.0, 0.5, -0.5;
  truth.rotation_rad.coefficients << 0.05, 0.01, 0.0, 0.0;
  truth.tilt_rad = 0.02;
  const Eigen::Vector3d center(4.0, -3.0, 5.0);
  const ScanImages images = simulated_scan(scan, truth, {Ball{center, 8.0, 0.02}});
  ThreadPool pool(2);
  const MuVolume volume =
      reconstruct_views(images, truth, CircularScan::every(0, 1, 120), {}, pool);
  // Within the ball: the approximation of FDK off the middle plane and of 120 views cost a percent.
  for (const Eigen::Vector3d& offset : {Eigen::Vector3d(0.0, 0.0, 0.0),
                                        Eigen::Vector3d(5.0, 0.0, 0.0),
                                        Eigen::Vector3d(0.0, -5.0, 0.0),
                                        Eigen::Vector3d(0.0, 0.0, 5.0)}) {
    EXPECT_NEAR(value_at(volume, center + offset), 0.02, 0.0004) << offset.transpose();
    EXPECT_NEAR(value_at(volume, center + 2.2 * offset), offset.norm() > 0.0 ? 0.0 : 0.02, 0.001)
        << offset.transpose();
  }
}

TEST_P(FdkAlong, ReachesAsFarAsTheDetectorSeesFromAFootAwayFromItsMiddle) {
  CircularScan scan = small_scan(GetParam());
  const bool along_columns = GetParam() == AxisAlong::Columns;
  // 30 px towards low heights, 10 across: 18 and 6 mm at the axis.
  scan.beam_foot_px = along_columns ? Eigen::Vector2d(scan.stated_foot_px().x() + 20.0, 25.5)
                                    : Eigen::Vector2d(25.5, scan.stated_foot_px().y() - 20.0);
  const ScanCalibration truth = ScanCalibration::nominal(scan);
  const Eigen::Vector3d center(3.0, -2.0, -20.0);
  const ScanImages images = simulated_scan(scan, truth, {Ball{center, 5.0, 0.02}});
  ThreadPool pool(2);
  const MuVolume volume =
      reconstruct_views(images, truth, CircularScan::every(0, 1, 120), {}, pool);
  EXPECT_NEAR(value_at(volume, center), 0.02, 0.0004);
  EXPECT_NEAR(value_at(volume, center + Eigen::Vector3d(8.0, 0.0, 0.0)), 0.0, 0.001);
}

TEST_P(FdkAlong, ADisplacedDetectorSeesTwiceAsFar) {
  for (const double displaced_px : {-16.0, 16.0}) {
    CircularScan scan = small_scan(GetParam());
    Eigen::Vector2d foot = scan.stated_foot_px();
    foot[GetParam() == AxisAlong::Columns ? 1 : 0] += displaced_px;
    scan.beam_foot_px = foot;
    const ScanCalibration truth = ScanCalibration::nominal(scan);
    // The wide side reaches 26 mm or more at the axis, the narrow one 12 mm or less.
    const Eigen::Vector3d center(15.0, -6.0, 3.0);
    const ScanImages images =
        simulated_scan(scan, truth, {Ball{center, 5.0, 0.02}, Ball{{0.0, 0.0, 0.0}, 6.0, 0.01}});
    ThreadPool pool(2);
    const MuVolume volume =
        reconstruct_views(images, truth, CircularScan::every(0, 1, 120), {}, pool);
    EXPECT_NEAR(value_at(volume, center), 0.02, 0.0006) << displaced_px;
    EXPECT_NEAR(value_at(volume, {0.0, 0.0, 0.0}), 0.01, 0.0003) << displaced_px;
    EXPECT_NEAR(value_at(volume, -center), 0.0, 0.001) << displaced_px;
  }
}

/// A shadow that is cut off at the detector's edge would leave a rim.
TEST_P(FdkAlong, AnObjectBeyondTheDetectorHasNoBrightRim) {
  CircularScan scan = small_scan(GetParam());
  scan.size_px[GetParam() == AxisAlong::Columns ? 1 : 0] = 30;
  const ScanCalibration truth = ScanCalibration::nominal(scan);
  const ScanImages images = simulated_scan(scan, truth, {Ball{{0.0, 0.0, 0.0}, 14.0, 0.02}});
  ThreadPool pool(2);
  const MuVolume volume =
      reconstruct_views(images, truth, CircularScan::every(0, 1, 120), {}, pool);
  const float middle = value_at(volume, {0.0, 0.0, 0.0});
  EXPECT_NEAR(middle, 0.02, 0.004);
  EXPECT_NEAR(value_at(volume, {7.0, 0.0, 0.0}), middle, 0.004);
}

TEST(Fdk, TakesUnevenAnglesByTheirShares) {
  const CircularScan scan = small_scan();
  const ScanCalibration truth = ScanCalibration::nominal(scan);
  const ScanImages images = simulated_scan(scan, truth, {Ball{{0.0, 0.0, 0.0}, 10.0, 0.02}});
  ThreadPool pool(2);
  std::vector<int> views = CircularScan::every(0, 1, 60);
  for (const int view : CircularScan::every(60, 2, 120)) views.push_back(view);
  const MuVolume volume = reconstruct_views(images, truth, views, {}, pool);
  EXPECT_NEAR(value_at(volume, {0.0, 0.0, 0.0}), 0.02, 0.0004);
  EXPECT_NEAR(value_at(volume, {0.0, 7.0, 0.0}), 0.02, 0.0004);
}

TEST(Fdk, DoesNotDependOnThreads) {
  const CircularScan scan = small_scan();
  const ScanCalibration truth = ScanCalibration::nominal(scan);
  const ScanImages images = simulated_scan(scan, truth, test::lopsided_balls());
  ThreadPool one(1);
  ThreadPool three(3);
  const std::vector<int> views = CircularScan::every(0, 5, 120);
  EXPECT_EQ(reconstruct_views(images, truth, views, {}, one).mu_per_mm,
            reconstruct_views(images, truth, views, {}, three).mu_per_mm);
}

TEST(LightShare, KeepsPlasticBesideMetal) {
  // 1 % of steel and 40 % of plastic within air with noise about 0.
  MuVolume volume{{{10, 10, 10}}, std::vector<float>(1000, 0.0F)};
  for (std::size_t i = 0; i < 1000; ++i) {
    volume.mu_per_mm[i] = i % 2 == 0 ? 0.001F : -0.001F;
    if (i < 400) volume.mu_per_mm[i] = 0.02F;
    if (i >= 990) volume.mu_per_mm[i] = 0.8F;
  }
  EXPECT_NEAR(reference_mu_per_mm(volume), 0.4, 1e-6);
  EXPECT_NEAR(light_share(volume, 0.04), 0.5, 0.01);
  const double water = registration_water_mu_per_mm(volume);
  EXPECT_LT(0.1 * water, 0.02) << "plastic is not air";
  EXPECT_GT(33.0 * water, 0.8) << "steel is within the scale";
  // Without metal nothing changes.
  for (std::size_t i = 990; i < 1000; ++i) volume.mu_per_mm[i] = 0.02F;
  EXPECT_EQ(registration_water_mu_per_mm(volume), reference_mu_per_mm(volume));
}

TEST(CtOf, IsTheHuScaleOfAWater) {
  const MuVolume volume{{{2, 2, 1}}, {0.0F, 0.02F, 0.04F, -0.02F}};
  const CtVolume ct = ct_of(volume, 0.02);
  EXPECT_EQ(std::vector<int>(ct.hu.begin(), ct.hu.end()),
            (std::vector<int>{-1000, 0, 1000, -2000}));
}

}  // namespace
}  // namespace af
