// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "register/problem/pose_target.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

Eigen::Vector3d center_ct() {
  return {5.0, -7.0, 3.0};
}

RigidTransform some_pose() {
  const PoseFrame frame = PoseFrame::about(RigidTransform::Identity(), center_ct());
  return pose_from_parameters(frame,
                              PoseParameters::from_deg_and_mm({20, -10, 30, 4.0, -3.0, 6.0}));
}

std::vector<View> two_views() {
  return {{test::small_camera(false), {10, 8, 20, 24}},
          {test::small_camera(true), {4, 12, 30, 20}}};
}

bool is_in_roi(const View& view, const Eigen::Vector3d& room_point) {
  const Eigen::Vector2d pixel = view.camera.project(room_point);
  return pixel.x() >= view.roi.column - 0.5 && pixel.y() >= view.roi.row - 0.5 &&
         pixel.x() < view.roi.column + view.roi.width - 0.5 &&
         pixel.y() < view.roi.row + view.roi.height - 0.5;
}

/// Mean displacement on the isocentre plane when parameter `index` changes by `step`, measured on
/// the detector.
double brute_force_displacement_mm(const std::vector<Eigen::Vector3d>& points,
                                   const std::vector<View>& views,
                                   int index,
                                   double step) {
  const RigidTransform start = some_pose();
  const PoseFrame frame = PoseFrame::about(start, center_ct());
  PoseParameters parameters;
  (index < 3 ? parameters.rotation_rad : parameters.translation_mm)[index % 3] = step;
  const RigidTransform moved = pose_from_parameters(frame, parameters);
  double sum = 0.0;
  int count = 0;
  for (const Eigen::Vector3d& point : points) {
    const bool seen = is_in_roi(views[0], start * point) || is_in_roi(views[1], start * point);
    if (!seen) continue;
    for (const View& view : views) {
      const Eigen::Vector2d shift_px =
          view.camera.project(moved * point) - view.camera.project(start * point);
      const double to_isocenter =
          view.camera.depth_mm(Eigen::Vector3d::Zero()) / view.camera.source_detector_distance_mm();
      sum += shift_px.cwiseProduct(view.camera.pixel_spacing_mm).norm() * to_isocenter;
      ++count;
    }
  }
  return sum / count;
}

TEST(ParameterScaling, EqualsTheMeasuredMeanDisplacement) {
  const std::vector<Eigen::Vector3d> points = ct_lattice_points(test::five_ellipsoids().grid, 12);
  const std::vector<View> views = two_views();
  const auto scaling =
      projected_motion_scaling(some_pose(), center_ct(), points, views, Eigen::Vector3d::Zero());
  ASSERT_TRUE(scaling.has_value());
  // Second-order terms: 1e-4 rad or mm against arms and depths of some 100 mm.
  constexpr double kStep = 1e-4;
  constexpr double kSecondOrder = 1e-4;
  for (int i = 0; i < 6; ++i) {
    const double per_unit = brute_force_displacement_mm(points, views, i, kStep) / kStep;
    EXPECT_NEAR(scaling->displacement_mm[i], per_unit, kSecondOrder * per_unit)
        << "parameter " << i;
  }
}

TEST(ParameterScaling, OneScaledUnitMovesProjectionsByOneMillimetre) {
  const std::vector<Eigen::Vector3d> points = ct_lattice_points(test::five_ellipsoids().grid, 12);
  const std::vector<View> views = two_views();
  const auto scaling =
      projected_motion_scaling(some_pose(), center_ct(), points, views, Eigen::Vector3d::Zero());
  ASSERT_TRUE(scaling.has_value());
  // Perspective and curvature: 1 mm against a depth of 650 mm and arms of some 50 mm.
  constexpr double kSecondOrder = 0.02;
  for (int i = 0; i < 6; ++i) {
    const PoseParameters unit = scaling->unscaled(ScaledParameters::Unit(i));
    const double step = i < 3 ? unit.rotation_rad[i] : unit.translation_mm[i - 3];
    EXPECT_NEAR(brute_force_displacement_mm(points, views, i, step), 1.0, kSecondOrder)
        << "parameter " << i;
  }
}

TEST(ParameterScaling, OfAPointAtTheIsocentreIsOneForTranslationsAcrossTheBeam) {
  const std::vector<Eigen::Vector3d> points = {Eigen::Vector3d::Zero()};
  const std::vector<View> views = {View::whole_detector(test::small_camera(false))};
  const auto scaling = projected_motion_scaling(
      RigidTransform::Identity(), Eigen::Vector3d::Zero(), points, views, Eigen::Vector3d::Zero());
  ASSERT_TRUE(scaling.has_value());
  EXPECT_NEAR(scaling->displacement_mm[3], 1.0, 1e-12);
  EXPECT_NEAR(scaling->displacement_mm[5], 1.0, 1e-12);
  // Along the beam, and about itself, it does not move at all; its step stays finite.
  EXPECT_EQ(scaling->displacement_mm[4], 1e-3);
  EXPECT_EQ(scaling->displacement_mm[0], 1e-3);
}

TEST(ParameterScaling, IsUndefinedWhenNoPointProjectsIntoARegion) {
  RigidTransform far_away = RigidTransform::Identity();
  far_away.translation() = Eigen::Vector3d(0, 0, 500);
  const auto views = two_views();
  EXPECT_FALSE(projected_motion_scaling(far_away,
                                        center_ct(),
                                        ct_lattice_points(test::five_ellipsoids().grid, 8),
                                        views,
                                        Eigen::Vector3d::Zero())
                   .has_value());
}

TEST(CtLatticePoints, FillTheVolumeToItsOuterFacesInEveryOrientation) {
  CtGrid grid;
  grid.size = {10, 20, 30};
  grid.spacing_mm = {2.0, 1.0, 0.5};
  grid.origin_mm = {3.0, 4.0, 5.0};
  grid.direction.col(0) = Eigen::Vector3d::UnitY();
  grid.direction.col(1) = -Eigen::Vector3d::UnitX();
  const std::vector<Eigen::Vector3d> points = ct_lattice_points(grid, 2);
  ASSERT_EQ(points.size(), 8U);
  // Cell centres lie at a quarter and three quarters between the outer faces.
  const Eigen::Vector3d first = grid.point_mm({-0.5 + 2.5, -0.5 + 5.0, -0.5 + 7.5});
  EXPECT_NEAR((points[0] - first).norm(), 0.0, 1e-12);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point / 8.0;
  EXPECT_NEAR((mean - grid.center_mm()).norm(), 0.0, 1e-12);
}

}  // namespace
}  // namespace af::registration
