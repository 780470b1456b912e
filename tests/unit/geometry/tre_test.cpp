// SPDX-License-Identifier: Apache-2.0
#include "geometry/tre.h"

#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/target_box.h"

namespace af {
namespace {

using Eigen::Vector3d;

constexpr double kTreRoundingMm = 1e-10;  // a few dozen double operations on values below 1000 mm

const CtBox kCube{{-30, -30, -30}, {30, 30, 30}};

TEST(TargetBox, PointsAreTheCentresOfEqualCells) {
  // 3 mm in cells of at most 2 mm: two cells of 1.5 mm; 2 mm: one; 5 mm: three of 5/3 mm.
  const std::vector<Vector3d> points = target_points({{0, 10, -5}, {3, 12, 0}}, 2.0);
  ASSERT_EQ(points.size(), 6u);
  EXPECT_LT((points[0] - Vector3d(0.75, 11, -5 + 5.0 / 6)).norm(), kTreRoundingMm);
  EXPECT_LT((points[1] - Vector3d(2.25, 11, -5 + 5.0 / 6)).norm(), kTreRoundingMm);
  EXPECT_LT((points[5] - Vector3d(2.25, 11, -5.0 / 6)).norm(), kTreRoundingMm);
}

TEST(TargetBox, CenterIsTheMeanOfItsPoints) {
  const Vector3d mean = mean_point(target_points({{0, 10, -5}, {3, 12, 0}}, 2.0));
  EXPECT_LT((mean - Vector3d(1.5, 11, -2.5)).norm(), kTreRoundingMm);
}

TEST(TargetBox, RefusesABoxWithoutVolume) {
  EXPECT_THROW(target_points({{0, 0, 0}, {1, 0, 1}}), InputError);
  EXPECT_THROW(target_points({{0, 0, 0}, {1, -1, 1}}), InputError);
  EXPECT_THROW(target_points({{0, 0, 0}, {1, std::nan(""), 1}}), InputError);
}

TEST(TargetBox, RefusesABoxLargerThanAnyCtOrThanMemoryHasRoomFor) {
  for (const double high_mm : {1e308, 1e12, 3e4, 500.0})
    EXPECT_THROW(target_points({{0, 0, 0}, {high_mm, high_mm, high_mm}}), InputError) << high_mm;
  EXPECT_THROW(target_points({{0, 0, 0}, {3e4, 1, 1}}), InputError);
  EXPECT_EQ(target_points({{0, 0, 0}, {1e4, 1, 1}}).size(), 5000U);
}

TEST(TargetBox, RmsRadiusEqualsThatOfManyPoints) {
  const CtBox box{{-10, 0, 5}, {20, 8, 30}};
  const Vector3d center(3, -2, 11);
  double squares = 0.0;
  const std::vector<Vector3d> points = target_points(box, 0.5);
  for (const Vector3d& point : points) squares += (point - center).squaredNorm();
  // The midpoint rule is h^2 / 12 per axis short of the integral of x^2: 3 * 0.25 / 12 = 0.06 mm^2
  // of about 300 mm^2, so 0.002 mm of the root.
  constexpr double kMidpointRuleMm = 0.003;
  EXPECT_NEAR(rms_radius_mm(box, center),
              std::sqrt(squares / static_cast<double>(points.size())),
              kMidpointRuleMm);
}

TEST(MeanTre, OfATranslationIsItsLength) {
  const RigidTransform gold = pose_from_parameters(
      PoseFrame{}, PoseParameters::from_deg_and_mm({20, -40, 70, 100, 200, -300}));
  RigidTransform moved = gold;
  moved.translation() += Vector3d(3, 4, 12);
  EXPECT_NEAR(mean_tre_mm(moved, gold, target_points(kCube)), 13.0, kTreRoundingMm);
}

TEST(MeanTre, LiesWithinItsBounds) {
  const std::vector<Vector3d> points = target_points({{-10, 0, -30}, {60, 20, 15}}, 5.0);
  const TreBounder bounder(points);
  const TreBounder finer(points, 12);
  HashRandom random(1, 2, 3);
  for (int draw = 0; draw < 1000; ++draw) {
    std::array<double, 6> deg_mm{};
    for (double& value : deg_mm) value = random.uniform(-20.0, 20.0);
    // Now and then a translation alone or a rotation alone.
    if (draw % 10 == 0) deg_mm[0] = deg_mm[1] = deg_mm[2] = 0.0;
    if (draw % 10 == 1) deg_mm[3] = deg_mm[4] = deg_mm[5] = 0.0;
    const RigidTransform pose =
        pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm(deg_mm));
    const double tre_mm = mean_tre_mm(pose, RigidTransform::Identity(), points);
    const TreBounds bounds = bounder.bounds(pose, RigidTransform::Identity());
    EXPECT_LE(bounds.low_mm, tre_mm);
    EXPECT_GE(bounds.high_mm, tre_mm);
    EXPECT_LT(bounds.high_mm - bounds.low_mm, 0.1 * tre_mm);
    const TreBounds closer = finer.bounds(pose, RigidTransform::Identity());
    EXPECT_LE(closer.low_mm, tre_mm);
    EXPECT_GE(closer.high_mm, tre_mm);
    EXPECT_LT(closer.high_mm - closer.low_mm, 0.02 * tre_mm);
    if (draw % 10 == 0) {
      EXPECT_LT(bounds.high_mm - bounds.low_mm, 1e-6);
    }
  }
}

TEST(MeanTre, OfEqualPosesIsZero) {
  const RigidTransform pose = pose_from_parameters(
      PoseFrame{}, PoseParameters::from_deg_and_mm({20, -40, 70, 100, 200, -300}));
  EXPECT_EQ(mean_tre_mm(pose, pose, target_points(kCube)), 0.0);
}

TEST(MeanTre, OfARotationIsTheChordTimesTheMeanDistanceFromTheAxis) {
  // Mean distance of a square's points (side a) from its centre: a (sqrt 2 + asinh 1) / 6.
  const double angle_rad = 0.2;
  PoseParameters turn;
  turn.rotation_rad.z() = angle_rad;
  const RigidTransform moved = pose_from_parameters(PoseFrame{}, turn);
  const double mean_distance_mm = 60.0 * (std::sqrt(2.0) + std::asinh(1.0)) / 6.0;
  const double expected_mm = 2.0 * std::sin(angle_rad / 2) * mean_distance_mm;
  // The midpoint rule over 2 mm cells: h^2 / 24 times the mean Laplacian of |x|, which is the mean
  // of 1 / |x|, 0.06 per mm here: 0.01 mm of 23 mm, times the chord 0.2.
  constexpr double kMidpointRuleMm = 0.003;
  EXPECT_NEAR(mean_tre_mm(moved, RigidTransform::Identity(), target_points(kCube)),
              expected_mm,
              kMidpointRuleMm);
}

TEST(MeanTre, OfATurnByHalfACircleAboutOneTargetPointIsTwiceItsDistance) {
  PoseParameters turn;
  turn.rotation_rad.x() = std::numbers::pi;
  const std::vector<Vector3d> points = {{0, 5, 0}, {7, 0, 0}};
  // The first is carried to (0, -5, 0), the second lies on the axis: mean of 10 and 0.
  EXPECT_NEAR(
      mean_tre_mm(pose_from_parameters(PoseFrame{}, turn), RigidTransform::Identity(), points),
      5.0,
      kTreRoundingMm);
}

TEST(MeanTre, OverCellsIsThatOverTheVoxelsOfACt) {
  // The paper's mean is over the CT's voxels in the box, here of 0.5 x 0.5 x 1 mm.
  std::vector<Vector3d> voxels;
  for (double z = -29.5; z < 30; z += 1.0)
    for (double y = -29.75; y < 30; y += 0.5)
      for (double x = -29.75; x < 30; x += 0.5) voxels.emplace_back(x, y, z);
  // A cell's centre stands for its mean up to h^2 / 24 of the Laplacian of the distance, which for
  // a turn by a is a / r, r from the axis: 4 / 24 * 0.030 * mean(1 / r) of 2 / 30 per mm is 3e-4
  // mm.
  constexpr double kCellMm = 1e-3;
  for (const auto& values : {std::array<double, 6>{1, -1, 1, 0, 0, 0},
                             std::array<double, 6>{0.3, 0.2, -0.5, 0.2, -0.1, 0.4}}) {
    const RigidTransform pose =
        pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm(values));
    EXPECT_NEAR(mean_tre_mm(pose, RigidTransform::Identity(), target_points(kCube)),
                mean_tre_mm(pose, RigidTransform::Identity(), voxels),
                kCellMm);
  }
}

TEST(MeanTre, DoesNotChangeWhenBothPosesAreMovedInTheRoom) {
  const auto points = target_points(kCube, 10.0);
  const RigidTransform a =
      pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm({2, -4, 7, 10, 20, -30}));
  const RigidTransform b =
      pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm({3, -5, 9, 11, 18, -33}));
  const RigidTransform move = pose_from_parameters(
      PoseFrame{}, PoseParameters::from_deg_and_mm({60, 50, -120, 400, 0, 70}));
  EXPECT_NEAR(mean_tre_mm(move * a, move * b, points), mean_tre_mm(a, b, points), kTreRoundingMm);
}

TEST(MeanTre, OfAPoseThatIsNotFiniteIsNan) {
  RigidTransform broken = RigidTransform::Identity();
  broken.translation().x() = std::nan("");
  EXPECT_TRUE(std::isnan(mean_tre_mm(broken, RigidTransform::Identity(), target_points(kCube))));
  EXPECT_THROW(mean_tre_mm(broken, broken, {}), InputError);
}

}  // namespace
}  // namespace af
