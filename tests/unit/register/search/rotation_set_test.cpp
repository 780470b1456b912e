// SPDX-License-Identifier: Apache-2.0
#include "register/search/rotation_set.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "geometry/rigid_transform.h"

namespace af::registration {
namespace {

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle();
}

double nearest_rad(const std::vector<Eigen::Matrix3d>& rotations, const Eigen::Matrix3d& rotation) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& other : rotations)
    nearest = std::min(nearest, angle_between(other, rotation));
  return nearest;
}

TEST(RotationSet, EveryRotationOfARangeHasOneNearby) {
  const MotionRange range(PoseParameters::from_deg_and_mm({-20, -5, 0, 0, 0, 0}),
                          PoseParameters::from_deg_and_mm({20, 15, 90, 0, 0, 0}));
  const double step = 10.0 * kRadPerDeg;
  const std::vector<Eigen::Matrix3d> rotations = rotations_of_range(range, step);
  EXPECT_EQ(rotations.size(), 4u * 2u * 9u);
  HashRandom random(1);
  for (int i = 0; i < 200; ++i) {
    const PoseParameters pose = random_pose(range, random);
    // Half a step about each of three axes. Turned axes are not orthogonal, so the sum is the
    // bound.
    EXPECT_LT(nearest_rad(rotations, rotation_from_angles(pose.rotation_rad)), 1.5 * step);
  }
}

TEST(RotationSet, KnowsTheOuterCellsOfARange) {
  // Four, two and nine cells of 10 degrees.
  const MotionRange range(PoseParameters::from_deg_and_mm({-20, -5, 0, 0, 0, 0}),
                          PoseParameters::from_deg_and_mm({20, 15, 90, 0, 0, 0}));
  const auto outer = [&](double x, double y, double z) {
    return in_outer_cells(range, 10.0 * kRadPerDeg, kRadPerDeg * Eigen::Vector3d(x, y, z))
        .to_string();  // z, y, x
  };
  EXPECT_EQ(outer(9, 14, 79), "000");
  EXPECT_EQ(outer(11, -4, 81), "101");
  EXPECT_EQ(outer(-15, 5, 9), "101");
  EXPECT_EQ(outer(-9, 5, 11), "000");
}

TEST(RotationSet, EveryRotationHasOneNearby) {
  const double step = 20.0 * kRadPerDeg;
  const std::vector<Eigen::Matrix3d> rotations = all_rotations(step);
  HashRandom random(2);
  double farthest = 0.0;
  for (int i = 0; i < 2000; ++i) {
    // A point uniform on the sphere of unit quaternions.
    Eigen::Vector4d q;
    do
      for (int k = 0; k < 4; ++k) q[k] = 2.0 * random.uniform() - 1.0;
    while (q.norm() > 1.0 || q.norm() < 1e-3);
    farthest = std::max(
        farthest, nearest_rad(rotations, Eigen::Quaterniond(q.normalized()).toRotationMatrix()));
  }
  // Half the diagonal of a cell of the grid. Between two of the cube's rotations cells are cut, and
  // their middles may be missing: up to half a step more.
  EXPECT_LT(farthest, (0.5 * std::numbers::sqrt3 + 0.5) * step);
  EXPECT_GT(farthest, 0.5 * step);
}

TEST(RotationSet, HasNoRotationTwice) {
  const std::vector<Eigen::Matrix3d> rotations = all_rotations(30.0 * kRadPerDeg);
  for (std::size_t i = 0; i < rotations.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      ASSERT_GT(angle_between(rotations[i], rotations[k]), 1e-6) << i << ' ' << k;
}

TEST(RotationSet, HalfTurnsAreRotations) {
  const std::vector<Eigen::Matrix3d> turns = half_turns();
  ASSERT_EQ(turns.size(), 4u);
  EXPECT_EQ(turns[0], Eigen::Matrix3d::Identity());
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Matrix3d& turn = turns[static_cast<std::size_t>(axis) + 1];
    EXPECT_NEAR(
        (turn - Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::Unit(axis)).toRotationMatrix())
            .norm(),
        0.0,
        1e-15);
  }
}

}  // namespace
}  // namespace af::registration
