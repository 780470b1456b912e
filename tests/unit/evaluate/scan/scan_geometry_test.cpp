// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/scan_geometry.h"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "geometry/rigid_transform.h"
#include "unit/evaluate/scan/calibration_distance.h"
#include "unit/evaluate/scan/simulated_scan.h"

namespace af {
namespace {

using test::calibration_distance_px;
using test::small_scan;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kRounding = 1e-9;  // of doubles of some hundred mm

class ScanCameraOf : public testing::TestWithParam<AxisAlong> {};
INSTANTIATE_TEST_SUITE_P(Axes, ScanCameraOf, testing::Values(AxisAlong::Columns, AxisAlong::Rows));

TEST_P(ScanCameraOf, SeesTheAxisAndIsNotMirrored) {
  const CircularScan scan = small_scan(GetParam());
  const ScanCalibration calibration = ScanCalibration::nominal(scan, {1, sweep_of(scan)});
  for (const double angle : scan.angles_rad) {
    const CameraGeometry camera = scan_camera(scan, calibration, angle);
    EXPECT_THAT(problems(camera), IsEmpty());
    EXPECT_FALSE(camera.is_mirrored());
    const Eigen::Vector2d origin = camera.project(Eigen::Vector3d::Zero());
    EXPECT_NEAR(origin.x(), 0.5 * (scan.size_px.x() - 1), kRounding);
    EXPECT_NEAR(origin.y(), 0.5 * (scan.size_px.y() - 1), kRounding);
    // 10 mm up the axis: 15 mm on the detector, towards larger columns or smaller rows.
    const Eigen::Vector2d up =
        camera.project({0.0, 0.0, 10.0}) - camera.project(Eigen::Vector3d::Zero());
    const double pixels = 10.0 * 300.0 / 200.0 / 0.9;
    EXPECT_NEAR(up.x(), GetParam() == AxisAlong::Columns ? pixels : 0.0, kRounding);
    EXPECT_NEAR(up.y(), GetParam() == AxisAlong::Columns ? 0.0 : -pixels, kRounding);
  }
}

TEST_P(ScanCameraOf, StandsWhereTheStatedFootIs) {
  CircularScan scan = small_scan(GetParam());
  scan.beam_foot_px = Eigen::Vector2d(20.0, 25.0);
  const CameraGeometry camera =
      scan_camera(scan, ScanCalibration::nominal(scan, {1, sweep_of(scan)}), scan.angles_rad[7]);
  EXPECT_LT((camera.project(Eigen::Vector3d::Zero()) - *scan.beam_foot_px).norm(), kRounding);
  // The same camera in pixels of twice the size: outer edges stay, so centres are halved about
  // -1/2.
  EXPECT_LT((scan.binned(2).stated_foot_px() - Eigen::Vector2d(9.75, 12.25)).norm(), kRounding);
}

TEST(CircularScan, MustGoAllTheWayRoundByItsEvenViewsAlone) {
  CircularScan scan = small_scan();
  EXPECT_THAT(problems(scan), IsEmpty());
  scan.angles_rad.clear();
  for (int i = 0; i < 180; ++i)  // even views of one half of the circle, odd ones of the other
    for (const int half : {0, 180}) scan.angles_rad.push_back((half + i) * kRadPerDeg);
  EXPECT_THAT(problems(scan), ElementsAre(HasSubstr("the even views leave")));
}

TEST(CircularScan, MayMissSomeViews) {
  CircularScan scan = small_scan();
  scan.angles_rad.erase(scan.angles_rad.begin() + 20, scan.angles_rad.begin() + 24);
  EXPECT_THAT(problems(scan), IsEmpty());
  scan.angles_rad.erase(scan.angles_rad.begin() + 20, scan.angles_rad.begin() + 30);
  EXPECT_THAT(problems(scan), ElementsAre(HasSubstr("must go all the way round")));
}

TEST(CircularScan, KeepsPixelsEnoughWhenBinned) {
  CircularScan scan = small_scan();
  scan.size_px = {64, 1024};
  EXPECT_EQ(scan.binned(4).size_px, Eigen::Vector2i(16, 256));
  EXPECT_THROW((void)scan.binned(5), InputError);
}

TEST(RoomForRegistration, EnlargesASmallScanAndChangesNoProjection) {
  const CircularScan scan = small_scan();
  CircularScan small = scan.enlarged(0.1);
  const int factor = room_for_registration(small);
  EXPECT_EQ(factor, 14) << "4.32 mm across, 20 mm to the axis";
  EXPECT_EQ(room_for_registration(small.enlarged(factor)), 1);
  const Eigen::Vector3d point(10.0, -7.0, 5.0);
  const auto pixel_of = [&](const CircularScan& taken, double size) -> Eigen::Vector2d {
    return scan_camera(taken, ScanCalibration::nominal(taken), 0.7).project(size * point);
  };
  EXPECT_LT((pixel_of(small, 0.1) - pixel_of(scan, 1.0)).norm(), kRounding);
}

TEST(ViewAtAxis, ReachesFromTheFootToTheEdges) {
  CircularScan scan = small_scan(AxisAlong::Rows);  // 72 x 60 px of 0.9 mm, 0.6 mm at the axis
  scan.beam_foot_px = Eigen::Vector2d(31.5, 19.5);
  AxisView view = view_at_axis(scan);
  EXPECT_NEAR(view.narrow_mm, 32 * 0.6, kRounding);
  EXPECT_NEAR(view.wide_mm, 40 * 0.6, kRounding);
  EXPECT_NEAR(view.highest_mm, 20 * 0.6, kRounding);  // up is towards smaller rows
  EXPECT_NEAR(view.lowest_mm, -40 * 0.6, kRounding);
  scan.axis_along = AxisAlong::Columns;  // up is towards larger columns
  view = view_at_axis(scan);
  EXPECT_NEAR(view.highest_mm, 40 * 0.6, kRounding);
  EXPECT_NEAR(view.lowest_mm, -32 * 0.6, kRounding);
  EXPECT_NEAR(view.narrow_mm, 20 * 0.6, kRounding);
}

TEST_P(ScanCameraOf, MovesImagesAsItsParametersSay) {
  const CircularScan scan = small_scan(GetParam());
  ScanCalibration calibration = ScanCalibration::nominal(scan);
  const Eigen::Vector3d point(3.0, 2.0, 8.0);
  const Eigen::Vector2d before = scan_camera(scan, calibration, 0.4).project(point);
  calibration.column_px.coefficients[0] += 2.0;
  calibration.row_px.coefficients[0] -= 1.0;
  const Eigen::Vector2d foot(calibration.column_px.at(0.4), calibration.row_px.at(0.4));
  const Eigen::Vector2d shifted = scan_camera(scan, calibration, 0.4).project(point);
  EXPECT_LT((shifted - before - Eigen::Vector2d(2.0, -1.0)).norm(), kRounding);
  constexpr double kTurn = 0.01;
  calibration.rotation_rad.coefficients[0] = kTurn;
  const Eigen::Vector2d turned = scan_camera(scan, calibration, 0.4).project(point) - foot;
  const Eigen::Vector2d from_foot = shifted - foot;
  EXPECT_NEAR(turned.x(), std::cos(kTurn) * from_foot.x() + std::sin(kTurn) * from_foot.y(), 1e-8);
  EXPECT_NEAR(turned.y(), std::cos(kTurn) * from_foot.y() - std::sin(kTurn) * from_foot.x(), 1e-8);
}

TEST(ScanCamera, TurnsAboutTheAxisAgainstTheObject) {
  // A camera turned by a sees the object as the first camera sees it turned by -a.
  const CircularScan scan = small_scan();
  const ScanCalibration calibration = ScanCalibration::nominal(scan);
  const Eigen::Vector3d point(5.0, -3.0, 4.0);
  const Eigen::Matrix3d back = rotation_from_angles({0.0, 0.0, -0.7});
  EXPECT_LT((scan_camera(scan, calibration, 0.7).project(point) -
             scan_camera(scan, calibration, 0.0).project(back * point))
                .norm(),
            kRounding);
}

TEST(ScanCalibration, BinsAndUnbins) {
  const CircularScan scan = small_scan();
  ScanCalibration calibration = ScanCalibration::nominal(scan, {2, sweep_of(scan)});
  calibration.column_px.coefficients << 30.0, 1.0, -2.0, 0.5, 0.25, 0.75;
  const Eigen::Vector3d point(3.0, 2.0, 8.0);
  const Eigen::Vector2d fine = scan_camera(scan, calibration, 0.4).project(point);
  const Eigen::Vector2d coarse =
      scan_camera(scan.binned(3), calibration.binned(3.0), 0.4).project(point);
  // The centre of a coarse pixel is that of its middle fine one.
  EXPECT_LT((3.0 * coarse + Eigen::Vector2d::Ones() - fine).norm(), kRounding);
  EXPECT_LT((calibration.binned(3.0).binned(1.0 / 3.0).column_px.coefficients -
             calibration.column_px.coefficients)
                .norm(),
            kRounding);
}

std::vector<double> in_rad(std::vector<double> angles_deg) {
  for (double& angle : angles_deg) angle *= kRadPerDeg;
  return angles_deg;
}

TEST(ContinuedAngles, LeaveOutTheJumpsOfAList) {
  const auto is_continued_as = [](const std::vector<double>& listed_deg,
                                  const std::vector<double>& expected_deg) {
    const auto found = continued_rad(in_rad(listed_deg));
    ASSERT_TRUE(found);
    EXPECT_THAT(*found, testing::Pointwise(testing::DoubleNear(kRounding), in_rad(expected_deg)));
  };
  is_continued_as({350, 355, 0, 5}, {350, 355, 360, 365});
  is_continued_as({-170, -175, 180, 175}, {-170, -175, -180, -185});
  // More than a turn, and a view at the first one's angle.
  is_continued_as({0, 90, 180, 270, 0, 90}, {0, 90, 180, 270, 360, 450});
  std::vector<double> with_jitter;
  for (int i = 0; i < 360; ++i) with_jitter.push_back(i == 200 ? 198.9 : i);
  is_continued_as(with_jitter, with_jitter);
  // Not in the order in which they were taken, or opposite views in turn.
  EXPECT_FALSE(continued_rad(in_rad({0, 50, 20, 70, 30})));
  EXPECT_FALSE(continued_rad(in_rad({0, 180, 1, 181})));
}

TEST(AngleBasis, DriftsByOneFromTheFirstViewToTheLast) {
  for (const double step_deg : {3.0, -3.0}) {
    const CircularScan scan = small_scan(AxisAlong::Rows, step_deg);
    const AngleBasis basis = {1, sweep_of(scan)};
    ASSERT_EQ(basis.size(), 4);
    EXPECT_NEAR(basis.at(scan.angles_rad.front())[3], -0.5, kRounding);
    EXPECT_NEAR(basis.at(scan.angles_rad[1])[3], -0.5 + 1.0 / 119.0, kRounding);
    EXPECT_NEAR(basis.at(scan.angles_rad.back())[3], 0.5, kRounding);
  }
  // The last view has the first one's angle, but comes after all others.
  CircularScan closed = small_scan();
  closed.angles_rad.push_back(closed.angles_rad.front() + 2.0 * std::numbers::pi);
  const AngleBasis basis = {0, sweep_of(closed)};
  EXPECT_NEAR(basis.at(closed.angles_rad.front())[1], -0.5, kRounding);
  EXPECT_NEAR(basis.at(closed.angles_rad.back())[1], 0.5, kRounding);
  std::swap(closed.angles_rad[10], closed.angles_rad[60]);
  EXPECT_FALSE(sweep_of(closed));
}

TEST(AngleShares, AreHalfTheGapsAndFillTheCircle) {
  constexpr double kDeg = std::numbers::pi / 180.0;
  const std::vector<double> shares =
      angle_shares_rad({0.0, 90.0 * kDeg, 120.0 * kDeg, 240.0 * kDeg, 360.0 * kDeg});
  // Two views share one place, at 0 and 360 degrees.
  EXPECT_NEAR(shares[0] + shares[4], (120.0 + 90.0) / 2.0 * kDeg, kRounding);
  EXPECT_NEAR(shares[1], (90.0 + 30.0) / 2.0 * kDeg, kRounding);
  EXPECT_NEAR(shares[2], (30.0 + 120.0) / 2.0 * kDeg, kRounding);
  EXPECT_NEAR(shares[3], 120.0 * kDeg, kRounding);
}

TEST(CircularScan, NamesWhatIsImpossible) {
  EXPECT_THAT(problems(small_scan()), IsEmpty());
  EXPECT_THAT(problems(small_scan(AxisAlong::Rows, -6.0)), IsEmpty()) << "two turns";
  EXPECT_THAT(problems(small_scan(AxisAlong::Rows, 1.5)),
              ElementsAre(HasSubstr("must go all the way round")));
  CircularScan scan = small_scan();
  scan.source_to_axis_mm = 0.0;
  EXPECT_THAT(problems(scan), ElementsAre(HasSubstr("source_to_axis_mm = 0")));
  scan = small_scan();
  scan.source_to_detector_mm = 150.0;
  EXPECT_THAT(problems(scan), ElementsAre(HasSubstr("must be above source_to_axis_mm")));
  scan = small_scan();
  scan.angles_rad.resize(10);
  EXPECT_THAT(problems(scan), ElementsAre(HasSubstr("views = 10")));
}

TEST(CalibrationDistance, KnowsNoMotionOfTheObject) {
  const CircularScan scan = small_scan();
  const ScanCalibration stated = ScanCalibration::nominal(scan, {3, sweep_of(scan)});
  EXPECT_NEAR(calibration_distance_px(scan, stated, stated, 10.0, 10.0), 0.0, kRounding);
  ScanCalibration other = stated;
  other.column_px.coefficients[3] = 0.5;  // cos 2a: root mean square 0.5 / sqrt(2)
  EXPECT_NEAR(calibration_distance_px(scan, stated, other, 10.0, 10.0), 0.354, 0.01);
  // A first harmonic is nearly a shift of the object: 0.5 px are 0.3 mm, at 200 mm from the source.
  other = stated;
  other.column_px.coefficients[1] = 0.5;
  EXPECT_LT(calibration_distance_px(scan, stated, other, 10.0, 10.0), 0.03);
}

}  // namespace
}  // namespace af
