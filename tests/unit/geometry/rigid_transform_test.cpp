// SPDX-License-Identifier: Apache-2.0
#include "geometry/rigid_transform.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/hash_random.h"

namespace af {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;

// A few products of matrices whose elements are below 1: each rounds by at most 1.1e-16.
constexpr double kRotationTolerance = 1e-14;
// The same with lengths up to 1000 mm.
constexpr double kLengthToleranceMm = 1e-11;
// Angles come from atan2 of elements that carry kRotationTolerance; away from gimbal lock (cosine
// of ry above 1e-2 here) their error grows at most by the cosine's inverse.
constexpr double kAngleToleranceRad = 1e-12;

constexpr double kHalfPi = std::numbers::pi / 2.0;

Matrix3d elementary(int axis, double angle) {
  const int next = (axis + 1) % 3;
  const int after = (axis + 2) % 3;
  Matrix3d rotation = Matrix3d::Identity();
  rotation(next, next) = std::cos(angle);
  rotation(next, after) = -std::sin(angle);
  rotation(after, next) = std::sin(angle);
  rotation(after, after) = std::cos(angle);
  return rotation;
}

Vector3d random_vector(HashRandom& random, double limit) {
  return {
      random.uniform(-limit, limit), random.uniform(-limit, limit), random.uniform(-limit, limit)};
}

PoseFrame random_frame(HashRandom& random) {
  return {rotation_from_angles(random_vector(random, std::numbers::pi)),
          random_vector(random, 300.0),
          random_vector(random, 300.0)};
}

TEST(RotationFromAngles, TurnsAboutFixedRoomAxesInTheOrderXThenYThenZ) {
  HashRandom random(1);
  for (int i = 0; i < 100; ++i) {
    const Vector3d angles = random_vector(random, std::numbers::pi);
    const Matrix3d expected =
        elementary(2, angles.z()) * elementary(1, angles.y()) * elementary(0, angles.x());
    EXPECT_LT((rotation_from_angles(angles) - expected).norm(), kRotationTolerance);
  }
}

TEST(RotationFromAngles, PositiveAngleAboutZTurnsXTowardsY) {
  const Vector3d turned = rotation_from_angles({0.0, 0.0, kHalfPi}) * Vector3d::UnitX();
  EXPECT_LT((turned - Vector3d::UnitY()).norm(), kRotationTolerance);
}

TEST(AnglesFromRotation, ReturnsTheAnglesWithinTheirRange) {
  HashRandom random(2);
  for (int i = 0; i < 1000; ++i) {
    Vector3d angles = random_vector(random, std::numbers::pi);
    angles.y() *= 0.49;  // |ry| < 0.49 pi: its cosine is above 1e-2
    const Vector3d found = angles_from_rotation(rotation_from_angles(angles));
    EXPECT_LT((found - angles).norm(), kAngleToleranceRad) << "draw " << i;
  }
}

TEST(AnglesFromRotation, ReproducesTheRotationAtAndNearGimbalLock) {
  for (const double sign : {-1.0, 1.0})
    for (const double distance : {0.0, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6, 1e-3}) {
      const Matrix3d rotation = rotation_from_angles({0.7, sign * (kHalfPi - distance), -0.4});
      const Vector3d angles = angles_from_rotation(rotation);
      // Where ry's cosine is below 1e-12, rz is set to 0, which costs at most that cosine per
      // element.
      constexpr double kLockTolerance = 3e-12;
      EXPECT_LT((rotation_from_angles(angles) - rotation).norm(), kLockTolerance)
          << "sign " << sign << ", distance " << distance;
      EXPECT_LE(std::abs(angles.y()), kHalfPi);
    }
}

TEST(AnglesFromRotation, SetsRzToZeroAtGimbalLock) {
  EXPECT_EQ(angles_from_rotation(rotation_from_angles({0.3, kHalfPi, 0.2})).z(), 0.0);
}

TEST(PoseFromParameters, IsTheContractsFormula) {
  HashRandom random(3);
  for (int i = 0; i < 100; ++i) {
    const PoseFrame frame = random_frame(random);
    const PoseParameters p{random_vector(random, 1.0), random_vector(random, 100.0)};
    const Vector3d x_ct = random_vector(random, 300.0);
    const Vector3d expected =
        frame.center_room_mm + p.translation_mm +
        elementary(2, p.rotation_rad.z()) * elementary(1, p.rotation_rad.y()) *
            elementary(0, p.rotation_rad.x()) * frame.rotation * (x_ct - frame.center_ct_mm);
    EXPECT_LT((pose_from_parameters(frame, p) * x_ct - expected).norm(), kLengthToleranceMm);
  }
}

TEST(PoseFromParameters, RotationLeavesTheCenterWhereItIs) {
  HashRandom random(4);
  const PoseFrame frame = random_frame(random);
  const PoseParameters p{random_vector(random, 3.0), Vector3d::Zero()};
  const Vector3d center = pose_from_parameters(frame, p) * frame.center_ct_mm;
  EXPECT_LT((center - frame.center_room_mm).norm(), kLengthToleranceMm);
}

TEST(ParametersFromPose, InvertPoseFromParameters) {
  HashRandom random(5);
  for (int i = 0; i < 1000; ++i) {
    const PoseFrame frame = random_frame(random);
    const PoseParameters p{random_vector(random, 1.5), random_vector(random, 200.0)};
    const PoseParameters found = parameters_from_pose(frame, pose_from_parameters(frame, p));
    EXPECT_LT((found.rotation_rad - p.rotation_rad).norm(), kAngleToleranceRad);
    EXPECT_LT((found.translation_mm - p.translation_mm).norm(), kLengthToleranceMm);
  }
}

TEST(PoseFrame, AboutAPoseHasItAsNominal) {
  HashRandom random(6);
  for (int i = 0; i < 100; ++i) {
    const RigidTransform pose = random_frame(random).nominal_room_from_ct();
    const Vector3d center = random_vector(random, 300.0);
    const PoseFrame frame = PoseFrame::about(pose, center);
    EXPECT_LT((frame.nominal_room_from_ct().matrix() - pose.matrix()).norm(), kLengthToleranceMm);
    EXPECT_EQ(frame.center_ct_mm, center);
  }
}

TEST(PoseFrame, AboutAnotherCenterKeepsThePoseButChangesTheNumbers) {
  HashRandom random(7);
  const PoseFrame frame = random_frame(random);
  const RigidTransform pose = pose_from_parameters(
      frame, PoseParameters::from_deg_and_mm({5.0, -4.0, 3.0, 10.0, 20.0, 30.0}));
  const PoseFrame other =
      PoseFrame::about(frame.nominal_room_from_ct(), frame.center_ct_mm + Vector3d(50.0, 0.0, 0.0));
  const PoseParameters numbers = parameters_from_pose(other, pose);
  EXPECT_LT((pose_from_parameters(other, numbers).matrix() - pose.matrix()).norm(),
            kLengthToleranceMm);
  // Turning 50 mm away by about 7 degrees moves by about 6 mm.
  EXPECT_GT((numbers.translation_mm - Vector3d(10.0, 20.0, 30.0)).norm(), 1.0);
}

TEST(PoseParameters, KeepTheOrderOfReportsInDegreesAndMillimetres) {
  const std::array<double, 6> values{1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  const PoseParameters p = PoseParameters::from_deg_and_mm(values);
  EXPECT_DOUBLE_EQ(p.rotation_rad.y(), 2.0 * std::numbers::pi / 180.0);
  EXPECT_EQ(p.translation_mm, Vector3d(4.0, 5.0, 6.0));
  const auto back = p.deg_and_mm();
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_DOUBLE_EQ(back[i], values[i]);
}

TEST(RigidityProblems, NameWhatIsNotRigid) {
  Matrix4d matrix = Matrix4d::Identity();
  EXPECT_TRUE(rigidity_problems(matrix).empty());
  matrix(0, 0) = 1.1;
  EXPECT_THAT(rigidity_problems(matrix), testing::ElementsAre(testing::HasSubstr("orthonormal")));
  matrix(0, 0) = -1.0;
  EXPECT_THAT(rigidity_problems(matrix), testing::ElementsAre(testing::HasSubstr("reflection")));
  matrix(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(rigidity_problems(matrix), testing::ElementsAre(testing::HasSubstr("not finite")));
  matrix = Matrix4d::Identity();
  matrix(3, 0) = 0.1;
  EXPECT_THAT(rigidity_problems(matrix), testing::ElementsAre(testing::HasSubstr("last row")));
}

TEST(RigidFromMatrix, MakesARoundedRotationExactlyOrthonormal) {
  Matrix4d matrix = Matrix4d::Identity();
  // Six decimals, as written by hand.
  matrix.topLeftCorner<3, 3>() << 0.936293, -0.275096, 0.218351, 0.289629, 0.956425, -0.036957,
      -0.198669, 0.097843, 0.975170;
  matrix(0, 3) = 12.5;
  ASSERT_TRUE(rigidity_problems(matrix).empty());
  const RigidTransform pose = rigid_from_matrix(matrix);
  const Matrix3d product = pose.linear().transpose() * pose.linear();
  EXPECT_LT((product - Matrix3d::Identity()).norm(), kRotationTolerance);
  constexpr double kWrittenDecimals = 2e-6;  // nine elements, each wrong by half of 1e-6 at most
  EXPECT_LT((pose.matrix() - matrix).norm(), kWrittenDecimals);
  EXPECT_EQ(pose.translation().x(), 12.5);
}

TEST(RigidFromMatrix, KeepsTheBitsOfAnExactRotation) {
  HashRandom random(8);
  for (int i = 0; i < 100; ++i) {
    const Matrix4d matrix = random_frame(random).nominal_room_from_ct().matrix();
    EXPECT_EQ(rigid_from_matrix(matrix).matrix(), matrix);
  }
}

TEST(RotationBetween, TakesOneDirectionToTheOther) {
  // Some directions are nearly, or exactly, opposite.
  std::vector<Vector3d> directions = {{1.0, 0.0, 0.0}, {-2.0, 0.0, 0.0}, {0.3, -4.0, 0.2}};
  for (const double aside : {0.0, 1e-8, 3e-6, 1e-4, 0.03, 0.05})
    directions.emplace_back(-0.3 + aside, 4.0, -0.2);
  for (const Vector3d& from : directions)
    for (const Vector3d& to : directions) {
      const Matrix3d rotation = rotation_between(from, to);
      // Within 1.4e-6 rad of opposite it is half a turn. Further away the error is the cosine's
      // rounding, some 1e-16, against its distance from -1 (above 1e-3; below, the quaternion is
      // normalized).
      const bool is_half_turn = from.normalized().dot(to.normalized()) < -1.0 + 1e-12;
      EXPECT_LT((rotation * from.normalized() - to.normalized()).norm(),
                is_half_turn ? 1.5e-6 : 1e-9);
      EXPECT_LT((rotation.transpose() * rotation - Matrix3d::Identity()).norm(), 1e-11);
      EXPECT_GT(rotation.determinant(), 0.0);
      // It turns by the smallest angle, so what is across both directions stays.
      if (!is_half_turn) {
        const Vector3d across = from.cross(to);
        EXPECT_LT((rotation * across - across).norm(), 1e-9 * across.norm() + 1e-300);
      }
    }
}

TEST(RotationAngleBetween, IsTheAngleOfTheRelativeRotation) {
  HashRandom random(9);
  const RigidTransform a = random_frame(random).nominal_room_from_ct();
  RigidTransform b = a;
  b.rotate(Eigen::AngleAxisd(0.3, Vector3d(1.0, 2.0, 3.0).normalized()));
  EXPECT_NEAR(rotation_angle_between_rad(a, b), 0.3, kAngleToleranceRad);
  EXPECT_NEAR(rotation_angle_between_rad(b, a), 0.3, kAngleToleranceRad);
}

TEST(PoseParameters, MoveThePoseAsTheirMotionsSay) {
  HashRandom random(21);
  for (int i = 0; i < 20; ++i) {
    const PoseFrame frame = random_frame(random);
    const PoseParameters parameters{random_vector(random, 1.0), random_vector(random, 50.0)};
    const RigidTransform pose = pose_from_parameters(frame, parameters);
    const Vector3d pivot = frame.center_room_mm + parameters.translation_mm;
    const Vector3d point_ct = random_vector(random, 100.0);
    const auto motions = motions_from_parameters(parameters);
    for (Eigen::Index k = 0; k < 6; ++k) {
      // Central differences of second order: third derivatives of rotations of 600 mm arms.
      constexpr double kStep = 1e-4;
      constexpr double kToleranceMm = 1e-5;
      const auto moved = [&](double step) {
        PoseParameters other = parameters;
        (k < 3 ? other.rotation_rad[k] : other.translation_mm[k - 3]) += step;
        return Vector3d(pose_from_parameters(frame, other) * point_ct);
      };
      const Vector3d expected = (moved(kStep) - moved(-kStep)) / (2.0 * kStep);
      const Vector3d axis = motions.col(k).head<3>();
      const Vector3d found =
          axis.cross(Vector3d(pose * point_ct) - pivot) + Vector3d(motions.col(k).tail<3>());
      EXPECT_LT((found - expected).norm(), kToleranceMm) << "parameter " << k;
    }
  }
}

}  // namespace
}  // namespace af
