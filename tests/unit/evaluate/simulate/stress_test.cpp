// SPDX-License-Identifier: Apache-2.0
// Everything --stress adds: occluders, a poorer CT, motion, calibration errors, their names.
#include "evaluate/simulate/stress.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "evaluate/simulate/calibration_error.h"
#include "evaluate/simulate/ct_degradation.h"
#include "evaluate/simulate/xray_simulator.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

using Eigen::Vector3d;
using ::testing::EndsWith;
using ::testing::HasSubstr;

/// Two orthogonal cameras, 900 mm from source to detector, magnification 1.5 at the isocentre.
std::vector<View> two_views() {
  const CameraGeometry front{"front",
                             {0.0, -600.0, 0.0},
                             {-127.5, 300.0, 127.5},
                             {1.0, 0.0, 0.0},
                             {0.0, 0.0, -1.0},
                             {1.0, 1.0},
                             {256, 256},
                             {}};
  CameraGeometry side = front;
  side.name = "side";
  side.source_point = {600.0, 0.0, 0.0};
  side.detector_origin_point = {-300.0, -127.5, 127.5};
  side.column_direction = {0.0, 1.0, 0.0};
  const RegionOfInterest roi{68, 78, 120, 100};
  return {{front, roi}, {side, roi}};
}

RigidTransform tilted_pose() {
  PoseFrame frame;
  frame.center_ct_mm = {4.0, -3.0, 2.0};
  return pose_from_parameters(frame,
                              PoseParameters::from_deg_and_mm({8.0, -5.0, 12.0, 3.0, -2.0, 4.0}));
}

const Vector3d center_ct_mm(4.0, -3.0, 2.0);

/// A block of soft tissue, 200 mm wide, in air.
CtVolume block(const Vector3d& spacing_mm, const std::array<int, 3>& size) {
  CtGrid grid;
  grid.size = size;
  grid.spacing_mm = spacing_mm;
  grid.origin_mm = {-100.0, -90.0, -80.0};
  return box_phantom(grid, {5, 5, 2}, {size[0] - 6, size[1] - 6, size[2] - 3}, 60);
}

/// Values that differ from voxel to voxel: a CT in which every displacement shows.
CtVolume textured(const std::array<int, 3>& size, double spacing_mm) {
  CtGrid grid;
  grid.size = size;
  grid.spacing_mm = Vector3d::Constant(spacing_mm);
  grid.origin_mm = -0.5 * spacing_mm * Vector3d(size[0] - 1, size[1] - 1, size[2] - 1);
  std::vector<std::int16_t> voxels(grid.voxel_count());
  for (std::size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = static_cast<std::int16_t>(hash64(i) % 2000);
  return {grid, SharedArray<std::int16_t>(std::move(voxels))};
}

TEST(SteelBall, ChordsHaveTheirClosedForm) {
  // Positions up to 1000 mm in double, square roots of differences near 1: 1e-10 mm and below.
  constexpr double kToleranceMm = 1e-8;
  const SteelBall ball{{3.0, -4.0, 5.0}, 2.5};
  const Vector3d direction = Vector3d(1.0, 2.0, -2.0) / 3.0;
  const Vector3d aside = direction.unitOrthogonal();
  const auto chord = [&](double offset_mm) {
    const Vector3d through = ball.center_point + offset_mm * aside;
    return ball.chord_length_mm(through - 700.0 * direction, through);
  };
  EXPECT_NEAR(chord(0.0), 5.0, kToleranceMm);
  EXPECT_NEAR(chord(1.5), 4.0, kToleranceMm);  // 3-4-5
  EXPECT_EQ(chord(2.51), 0.0);
  // Behind the source there is nothing.
  EXPECT_EQ(ball.chord_length_mm(ball.center_point + 10.0 * direction,
                                 ball.center_point + 20.0 * direction),
            0.0);
}

TEST(PlacedRods, CrossTheRegionOfInterestOfEveryView) {
  OccluderOptions options;
  options.rod_count = 40;
  const std::vector<View> views = two_views();
  const OccluderSite site = occluder_site(views, tilted_pose(), center_ct_mm);
  // 100 rows of 1 mm at a magnification of about 1.5.
  EXPECT_NEAR(site.reach_mm, 50.0 / 1.5, 1.0);
  for (const SteelCylinder& rod : place_rods(site, options, 3, 7)) {
    EXPECT_NEAR(rod.axis_direction.norm(), 1.0, 1e-12);
    const double offset_mm = (rod.center_point - center_ct_mm).norm();
    EXPECT_GE(offset_mm, 0.2 * site.reach_mm);
    EXPECT_LE(offset_mm, 0.6 * site.reach_mm);
    for (const View& view : views) {
      const Eigen::Vector2d pixel = view.camera.project(tilted_pose() * rod.center_point);
      EXPECT_GT(pixel.x(), view.roi.column);
      EXPECT_LT(pixel.x(), view.roi.column + view.roi.width - 1);
      EXPECT_GT(pixel.y(), view.roi.row);
      EXPECT_LT(pixel.y(), view.roi.row + view.roi.height - 1);
    }
    for (const Vector3d& beam : site.beam_directions_ct)
      EXPECT_LE(std::abs(beam.dot(rod.axis_direction)), std::cos(30.0 * kRadPerDeg) + 1e-12);
  }
}

TEST(PlacedBalls, LieApartWithinTheRegionsAndAwayFromThePins) {
  OccluderOptions options;
  options.ball_count = 30;
  const OccluderSite site = occluder_site(two_views(), tilted_pose(), center_ct_mm);
  SteelCylinder pin;
  pin.center_point = center_ct_mm;
  const std::vector<SteelBall> balls = place_balls(site, {pin}, options, 3, 7);
  ASSERT_EQ(balls.size(), 30u);
  for (std::size_t i = 0; i < balls.size(); ++i) {
    EXPECT_GE((balls[i].center_point - center_ct_mm).norm(), 8.0);
    EXPECT_LE((balls[i].center_point - center_ct_mm).norm(), 0.8 * site.reach_mm);
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_GE((balls[i].center_point - balls[j].center_point).norm(), 9.0);
  }
}

TEST(PlacedOccluders, DependOnSeedAndKeyOnly) {
  const OccluderOptions options;
  const OccluderSite site = occluder_site(two_views(), tilted_pose(), center_ct_mm);
  const auto first_rod = [&](std::uint64_t seed, std::uint64_t key) {
    return place_rods(site, options, seed, key).front().center_point;
  };
  EXPECT_EQ(first_rod(1, 2), first_rod(1, 2));
  EXPECT_NE(first_rod(1, 2), first_rod(2, 2));
  EXPECT_NE(first_rod(1, 2), first_rod(1, 3));
}

TEST(PlacedOccluders, DarkenTheirOwnPixelsByTheSteelOnTheRay) {
  const CtVolume ct = block({4.0, 4.0, 4.0}, {50, 45, 40});
  const AttenuationVolume volume(ct, {});
  const std::vector<View> views = two_views();
  const RigidTransform pose = tilted_pose();
  const OccluderSite site = occluder_site(views, pose, center_ct_mm);
  const SteelBodies steel{place_rods(site, {}, 3, 7), place_balls(site, {}, {}, 3, 8)};
  const XraySimulationOptions ideal = XraySimulationOptions::ideal();
  const CameraGeometry& camera = views[0].camera;
  const Image2d with = XraySimulator(volume, steel, ideal).primary_image(camera, pose);
  const Image2d without = XraySimulator(volume, {}, ideal).primary_image(camera, pose);
  const auto is_darker = [&](const Vector3d& ct_point) {
    const Eigen::Vector2d pixel = camera.project(pose * ct_point).array().round();
    const auto column = static_cast<int>(pixel.x());
    const auto row = static_cast<int>(pixel.y());
    // Even 1 mm of iron takes about half of the effective energy.
    return with.at(column, row) < 0.6f * without.at(column, row);
  };
  for (const SteelCylinder& rod : steel.cylinders) EXPECT_TRUE(is_darker(rod.center_point));
  for (const SteelBall& ball : steel.balls) EXPECT_TRUE(is_darker(ball.center_point));
  std::size_t changed = 0;
  for (std::size_t i = 0; i < with.pixels.size(); ++i)
    changed += with.pixels[i] != without.pixels[i] ? 1u : 0u;
  // Two rods of at most 150 * 1.5 by 4 * 1.5 px (a little more where they are near the source),
  // eight balls of 4.5 px: nothing else may change.
  EXPECT_GT(changed, 500u);
  EXPECT_LT(changed, 4500u);
}

TEST(DegradedCt, KeepsEveryVoxelWhereItsMeanIs) {
  const CtVolume ct = textured({9, 8, 11}, 1.5);
  CtDegradationOptions options;
  options.slice_mm = 3.0;
  options.noise_hu = 0.0;
  options.step_hu = 1;
  const CtVolume poor = degraded_ct(ct, options, -900, 1, 2);
  EXPECT_EQ(poor.grid.size, (std::array<int, 3>{9, 8, 5}));  // the eleventh slice is left over
  EXPECT_EQ(poor.grid.spacing_mm, Vector3d(1.5, 1.5, 3.0));
  const std::size_t slice = 72;
  for (int k = 0; k < 5; ++k) {
    const Vector3d middle = 0.5 * (ct.grid.point_mm(Vector3d(2, 3, 2 * k)) +
                                   ct.grid.point_mm(Vector3d(2, 3, 2 * k + 1)));
    EXPECT_LT((poor.grid.point_mm(Vector3d(2, 3, k)) - middle).norm(), 1e-12);
    const std::size_t below = static_cast<std::size_t>(2 * k) * slice + 29;
    const double mean = 0.5 * (ct.hu[below] + ct.hu[below + slice]);
    EXPECT_NEAR(poor.hu[static_cast<std::size_t>(k) * slice + 29], mean, 0.5);
  }
}

TEST(DegradedCt, HasTheStatedNoiseAndSteps) {
  const CtVolume ct = block({2.0, 2.0, 1.0}, {100, 90, 60});
  const CtDegradationOptions options;
  const CtVolume poor = degraded_ct(ct, options, -900, 1, 2);
  EXPECT_NEAR(poor.grid.spacing_mm.z(), 3.0, 1e-12);
  double sum = 0.0;
  double squares = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < poor.grid.voxel_count(); ++i) {
    const int hu = poor.hu[i];
    EXPECT_EQ(hu % 20, 0);
    // Air keeps its value: noise could only make it attenuate.
    if (hu <= -900) {
      EXPECT_EQ(hu, -1000);
      continue;
    }
    if (hu < -200) continue;  // slices that straddle the block's end
    sum += hu;
    squares += hu * hu;
    ++count;
  }
  const double mean = sum / static_cast<double>(count);
  const double deviation = std::sqrt(squares / static_cast<double>(count) - mean * mean);
  // Rounding to steps of 20 adds 20^2 / 12 to the variance of 30^2; more than 90 000 voxels: five
  // standard errors are 0.5 HU of the mean and 0.4 of the deviation.
  EXPECT_GT(count, 90000u);
  EXPECT_NEAR(mean, 60.0, 0.5);
  EXPECT_NEAR(deviation, std::sqrt(900.0 + 400.0 / 12.0), 0.4);
}

TEST(DegradedCt, DependsOnSeedAndKeyButNotOnThreads) {
  const CtVolume ct = textured({20, 20, 20}, 1.5);
  CtDegradationOptions options;
  const auto voxels = [&](std::uint64_t seed, std::uint64_t key, int threads) {
    options.threads = threads;
    const CtVolume poor = degraded_ct(ct, options, -900, seed, key);
    return std::vector<std::int16_t>(poor.hu.view().begin(), poor.hu.view().end());
  };
  EXPECT_EQ(voxels(1, 2, 1), voxels(1, 2, 3));
  EXPECT_NE(voxels(1, 2, 1), voxels(2, 2, 1));
  EXPECT_NE(voxels(1, 2, 1), voxels(1, 3, 1));
}

TEST(DegradedCt, RefusesToLeaveLessThanTwoSlices) {
  CtDegradationOptions options;
  options.slice_mm = 50.0;
  EXPECT_THROW(degraded_ct(textured({9, 8, 11}, 1.5), options, -900, 1, 2), InputError);
}

const CtBox still_box{{-10.0, -12.0, -9.0}, {11.0, 10.0, 8.0}};

TEST(SmoothMotion, VanishesInTheTargetBoxAndItsMargin) {
  const SmoothMotionOptions options;
  const SmoothMotion motion(still_box, options, 5, 6);
  HashRandom random(9);
  double largest = 0.0;
  for (int n = 0; n < 4000; ++n) {
    const Vector3d point(
        random.uniform(-90.0, 90.0), random.uniform(-90.0, 90.0), random.uniform(-90.0, 90.0));
    const Vector3d nearest = point.cwiseMax(still_box.low_mm).cwiseMin(still_box.high_mm);
    const double distance_mm = (point - nearest).norm();
    const Vector3d displacement = motion.displacement_mm(point);
    if (distance_mm <= options.margin_mm) {
      EXPECT_EQ(displacement, Vector3d(Vector3d::Zero()));
    }
    EXPECT_LE(displacement.cwiseAbs().maxCoeff(), options.amplitude_mm);
    largest = std::max(largest, displacement.cwiseAbs().maxCoeff());
  }
  EXPECT_GT(largest, 0.95 * options.amplitude_mm);
}

TEST(SmoothMotion, NeverFoldsSpace) {
  // Neighbours keep their order in every direction, |d(x) - d(y)| < |x - y|.
  const SmoothMotion motion(still_box, {}, 5, 6);
  HashRandom random(10);
  constexpr double kStepMm = 0.01;
  for (int n = 0; n < 4000; ++n) {
    const Vector3d point(
        random.uniform(-60.0, 60.0), random.uniform(-60.0, 60.0), random.uniform(-60.0, 60.0));
    const Vector3d step =
        kStepMm * Vector3d(random.normal(), random.normal(), random.normal()).normalized();
    EXPECT_LT((motion.displacement_mm(point + step) - motion.displacement_mm(point)).norm(),
              kStepMm);
  }
}

TEST(SmoothMotion, DisplacesALineAsItsPoints) {
  const SmoothMotion motion(still_box, {}, 5, 6);
  const Vector3d step_mm(3.0, -6.0, 4.0);
  std::vector<Vector3d> points;
  for (int i = 0; i < 60; ++i) points.emplace_back(Vector3d(-90.0, 180.0, -120.0) + i * step_mm);
  std::vector<Vector3d> displaced = points;
  motion.displace(displaced);
  int still = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3d expected = points[i] + motion.displacement_mm(points[i]);
    EXPECT_LT((displaced[i] - expected).norm(), 1e-12) << i;
    still += expected == points[i] ? 1 : 0;
  }
  EXPECT_GT(still, 1);
  EXPECT_LT(still, 30);
}

TEST(SmoothMotion, MovesVoxelsOutsideTheBoxAndKeepsThoseWithin) {
  const CtVolume ct = textured({60, 60, 60}, 3.0);
  SmoothMotionOptions options;
  options.threads = 1;
  const CtVolume moved = SmoothMotion(still_box, options, 5, 6).moved(ct);
  EXPECT_EQ(moved.grid.size, ct.grid.size);
  EXPECT_EQ(moved.grid.origin_mm, ct.grid.origin_mm);
  std::size_t changed = 0;
  std::size_t voxel = 0;
  for (int k = 0; k < 60; ++k)
    for (int j = 0; j < 60; ++j)
      for (int i = 0; i < 60; ++i, ++voxel) {
        const Vector3d point = ct.grid.point_mm(Vector3d(i, j, k));
        const bool is_still = (point.array() >= still_box.low_mm.array()).all() &&
                              (point.array() <= still_box.high_mm.array()).all();
        if (is_still) {
          ASSERT_EQ(moved.hu[voxel], ct.hu[voxel]);
        }
        changed += moved.hu[voxel] != ct.hu[voxel] ? 1u : 0u;
      }
  EXPECT_GT(changed, ct.grid.voxel_count() / 2);
  options.threads = 3;
  const CtVolume again = SmoothMotion(still_box, options, 5, 6).moved(ct);
  EXPECT_TRUE(std::equal(again.hu.view().begin(), again.hu.view().end(), moved.hu.view().begin()));
}

TEST(SmoothMotion, ShowsAtAPointWhatWasAtItsDisplacedPlace) {
  // A linear ramp of HU is interpolated exactly, so the moved CT differs by the displacement times
  // the slope, up to rounding to whole HU.
  CtVolume ct = textured({60, 60, 60}, 3.0);
  std::vector<std::int16_t> ramp(ct.grid.voxel_count());
  for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<std::int16_t>(30 * (i % 60));
  ct.hu = SharedArray<std::int16_t>(std::move(ramp));
  const SmoothMotion motion(still_box, {}, 5, 6);
  const CtVolume moved = motion.moved(ct);
  for (int i = 5; i < 55; ++i) {
    const Vector3d point = ct.grid.point_mm(Vector3d(i, 12, 50));
    const std::size_t voxel = (std::size_t{50} * 60 + 12) * 60 + static_cast<std::size_t>(i);
    EXPECT_NEAR(moved.hu[voxel], 30.0 * i + 10.0 * motion.displacement_mm(point).x(), 0.5 + 1e-9);
  }
}

TEST(CalibrationError, MovesTheTargetBoxByTheStatedRms) {
  constexpr double kTolerancePx = 1e-9;  // twelve corrections of a nearly linear relation
  for (const View& view : two_views())
    for (const double error_px : {0.2, 1.0}) {
      const CameraGeometry moved =
          camera_with_calibration_error(view.camera, tilted_pose(), still_box, error_px, 1, 2);
      EXPECT_TRUE(problems(moved).empty());
      EXPECT_EQ(moved.name, view.camera.name);
      double sum = 0.0;
      for (const Vector3d& corner : still_box.corner_points())
        sum += (moved.project(tilted_pose() * corner) - view.camera.project(tilted_pose() * corner))
                   .squaredNorm();
      EXPECT_NEAR(std::sqrt(sum / 8.0), error_px, kTolerancePx);
      EXPECT_NE(moved.source_point, view.camera.source_point);
      EXPECT_NE(moved.detector_origin_point, view.camera.detector_origin_point);
    }
}

TEST(StressOptions, AllNamesEveryEffect) {
  StressOptions options;
  EXPECT_TRUE(descriptions(options).empty());
  options.names = {"motion", "rods"};
  EXPECT_TRUE(options.has(Stress::Rods));
  EXPECT_FALSE(options.has(Stress::Heel));
  const auto two = descriptions(options);
  ASSERT_EQ(two.size(), 2u);
  EXPECT_EQ(two[0].name, "rods");
  EXPECT_THAT(two[0].text, HasSubstr("2 steel rods of 4 mm"));
  options.names = {"all"};
  EXPECT_EQ(descriptions(options).size() + 1, stress_names().size());
}

TEST(StressOptions, ADegradedCtLeavesTheXraysWithTheOriginalOneUnlessThatMoved) {
  const auto text_of = [](const std::vector<std::string>& names) {
    StressOptions options;
    options.names = names;
    return descriptions(options).front().text;
  };
  EXPECT_THAT(text_of({"degraded-ct"}), EndsWith("the X-rays show the original CT"));
  EXPECT_THAT(text_of({"degraded-ct", "motion"}),
              EndsWith("the X-rays show the original CT, moved"));
}

TEST(StressOptions, ChangeOnlyTheWantedPartsOfTheDetector) {
  StressOptions options;
  const DetectorOptions clean;
  options.names = {"rods"};
  EXPECT_EQ(options.detector(clean).heel_ramp, 0.0);
  EXPECT_EQ(options.detector(clean).photons_per_pixel, clean.photons_per_pixel);
  options.names = {"heel", "noise"};
  EXPECT_EQ(options.detector(clean).heel_ramp, 0.25);
  EXPECT_EQ(options.detector(clean).photons_per_pixel, 2e4);
  EXPECT_EQ(options.detector(clean).scatter_source, ScatterSource::Object);
  options.names = {"scatter"};
  EXPECT_EQ(options.detector(clean).scatter_to_primary_ratio, 2.0);
  EXPECT_EQ(options.detector(clean).scatter_source, ScatterSource::ObjectAndOpenBeam);
}

}  // namespace
}  // namespace af
