// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/lattice_errors.h"

#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <gtest/gtest.h>

namespace af::evaluation {
namespace {

constexpr int kFractions = 4;

/// Two cameras at right angles, 2600 mm from the isocentre.
std::array<CellView, 2> two_views() {
  std::array<CellView, 2> views;
  views[0].camera.source_point = {0, -2600, 0};
  views[0].camera.column_direction = {1, 0, 0};
  views[0].camera.row_direction = {0, 0, -1};
  views[0].spacing_mm = {17.5, 21.9, 1.1, 1.0};
  views[1].camera.source_point = {2600, 0, 0};
  views[1].camera.column_direction = {0, 1, 0};
  views[1].camera.row_direction = {0, 0, -1};
  views[1].spacing_mm = {17.5, 30.0, 0.7, 1.0};
  return views;
}

TEST(LatticeErrors, StepsMoveEveryCameraByOneCell) {
  const std::array<CellView, 2> views = two_views();
  const Eigen::Vector3d center(5, -3, 8);
  const std::array<PoseParameters, kCellAxes> steps = cell_steps(views, center);
  // A turn by one cell of 73 mm is 0.03 rad. In a tenth of it, the nonlinear part is 2e-5 of it.
  constexpr double kPart = 0.1;
  constexpr double kNotLinear = 1e-2;
  for (std::size_t axis = 0; axis < kCellAxes; ++axis)
    for (const CellView& view : views) {
      PoseParameters part;
      part.rotation_rad = kPart * steps[axis].rotation_rad;
      part.translation_mm = kPart * steps[axis].translation_mm;
      const PoseFrame frame =
          PoseFrame::about(RigidTransform(Eigen::Translation3d(center)), Eigen::Vector3d::Zero());
      const RigidTransform moved =
          pose_from_parameters(frame, part) * frame.nominal_room_from_ct().inverse();
      // How the camera moves as seen from the patient.
      const Eigen::Vector3d change =
          moved.inverse() * view.camera.source_point - view.camera.source_point;
      const Eigen::Vector3d along =
          axis % 2 == 0 ? view.camera.column_direction : view.camera.row_direction;
      EXPECT_NEAR(change.dot(along),
                  kPart * view.spacing_mm[axis],
                  kNotLinear * kPart * view.spacing_mm[axis])
          << kCellAxisNames[axis];
    }
}

TEST(LatticeErrors, PosesAreBalanced) {
  const std::vector<LatticePose> poses = lattice_poses({}, kFractions);
  ASSERT_EQ(poses.size(), 64u);
  std::map<std::array<int, 4>, int> pairs;  // axis, axis, fraction, fraction
  for (const LatticePose& pose : poses)
    for (int a = 0; a < kCellAxes; ++a)
      for (int b = a + 1; b < kCellAxes; ++b)
        ++pairs[{a,
                 b,
                 pose.fraction[static_cast<std::size_t>(a)],
                 pose.fraction[static_cast<std::size_t>(b)]}];
  EXPECT_EQ(pairs.size(), 6u * 16u);
  for (const auto& [key, count] : pairs) EXPECT_EQ(count, 4);
}

TEST(LatticeErrors, PosesSurroundTheCellsCentre) {
  std::array<PoseParameters, kCellAxes> steps;
  steps[2].translation_mm = {0.8, 0, 0};
  const std::vector<LatticePose> poses = lattice_poses(steps, kFractions);
  for (const LatticePose& pose : poses)
    EXPECT_DOUBLE_EQ(pose.parameters.translation_mm.x(), -0.3 + 0.2 * pose.fraction[2]);
}

TEST(LatticeErrors, AmplitudeIsThatOfAPatternAlongOneAxis) {
  const std::vector<LatticePose> poses = lattice_poses({}, kFractions);
  std::vector<std::array<double, 6>> errors;
  for (const LatticePose& pose : poses) {
    std::array<double, 6> error{};
    error[3] = 5.0 + 0.25 * (pose.fraction[2] % 2);               // along s, about an offset
    error[4] = pose.fraction[0] == pose.fraction[1] ? 1.0 : 0.0;  // along neither u nor v alone
    errors.push_back(error);
  }
  errors[7].fill(std::numeric_limits<double>::quiet_NaN());
  EXPECT_DOUBLE_EQ(amplitude_along(2, poses, errors, kFractions)[3], 0.125);
  EXPECT_DOUBLE_EQ(amplitude_along(2, poses, errors, kFractions)[0], 0.0);
  errors[7] = {0, 0, 0, 5.0 + 0.25 * (poses[7].fraction[2] % 2), 0, 0};
  EXPECT_DOUBLE_EQ(amplitude_along(3, poses, errors, kFractions)[3], 0.0);
}

TEST(LatticeErrors, AmplitudeWithoutErrorsIsNan) {
  const std::vector<LatticePose> poses = lattice_poses({}, 2);
  std::vector<std::array<double, 6>> errors(poses.size());
  for (auto& error : errors) error.fill(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(std::isnan(amplitude_along(0, poses, errors, 2)[3]));
}

}  // namespace
}  // namespace af::evaluation
