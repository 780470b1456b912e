// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/sample_summary.h"
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

/// Displacements of every seen point in every view after a small motion, mm. They are measured on
/// the detector and scaled to the isocentre plane.
std::vector<double> brute_force_displacements_mm(const std::vector<Eigen::Vector3d>& points,
                                                 const std::vector<View>& views,
                                                 const PoseVector& motion) {
  const RigidTransform start = some_pose();
  const PoseFrame frame = PoseFrame::about(start, center_ct());
  const RigidTransform moved =
      pose_from_parameters(frame, PoseParameters{motion.head<3>(), motion.tail<3>()});
  std::vector<double> displacements_mm;
  for (const Eigen::Vector3d& point : points) {
    const bool seen = std::any_of(views.begin(), views.end(), [&](const View& view) {
      return is_in_roi(view, start * point);
    });
    if (!seen) continue;
    for (const View& view : views) {
      const Eigen::Vector2d shift_px =
          view.camera.project(moved * point) - view.camera.project(start * point);
      const double to_isocenter =
          view.camera.depth_mm(Eigen::Vector3d::Zero()) / view.camera.source_detector_distance_mm();
      displacements_mm.push_back(shift_px.cwiseProduct(view.camera.pixel_spacing_mm).norm() *
                                 to_isocenter);
    }
  }
  return displacements_mm;
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
    const double per_unit =
        mean_of(brute_force_displacements_mm(points, views, kStep * PoseVector::Unit(i))) / kStep;
    EXPECT_NEAR(scaling->displacement_mm[i], per_unit, kSecondOrder * per_unit)
        << "parameter " << i;
  }
}

double root_mean_square(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

TEST(ProjectedMotionBasis, MakesMotionsOfOneMillimetre) {
  const std::vector<Eigen::Vector3d> points = ct_lattice_points(test::five_ellipsoids().grid, 12);
  for (const std::size_t view_count : {1u, 2u}) {
    std::vector<View> views = two_views();
    views.resize(view_count);
    const auto basis =
        projected_motion_basis(some_pose(), center_ct(), points, views, Eigen::Vector3d::Zero());
    ASSERT_TRUE(basis.has_value());
    // Along the beam 1 mm in the image takes some 20 mm: second-order terms of a thousandth of that
    // are 1e-4 of the depths.
    constexpr double kStep = 1e-3;
    constexpr double kSecondOrder = 1e-3;
    const auto measured_mm = [&](const PoseVector& parameters) {
      return root_mean_square(
                 brute_force_displacements_mm(points, views, kStep * (*basis * parameters))) /
             kStep;
    };
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(measured_mm(PoseVector::Unit(i)), 1.0, kSecondOrder);
    // Motions must not depend on each other.
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < i; ++j)
        EXPECT_NEAR(measured_mm(PoseVector::Unit(i) + PoseVector::Unit(j)),
                    std::sqrt(2.0),
                    std::sqrt(2.0) * kSecondOrder);
    double longest_mm = 0.0;
    for (int i = 0; i < 6; ++i) longest_mm = std::max(longest_mm, basis->col(i).tail<3>().norm());
    if (view_count == 1)
      EXPECT_GT(longest_mm, 10.0) << "depth";
    else
      EXPECT_LT(longest_mm, 3.0);
  }
}

TEST(ProjectedMotionBasis, OfAPointIsFiniteAndOfNoneUndefined) {
  const std::vector<Eigen::Vector3d> points = {Eigen::Vector3d::Zero()};
  const std::vector<View> views = {View::whole_detector(test::small_camera(false))};
  const auto basis = projected_motion_basis(
      RigidTransform::Identity(), Eigen::Vector3d::Zero(), points, views, Eigen::Vector3d::Zero());
  ASSERT_TRUE(basis.has_value());
  EXPECT_TRUE(basis->allFinite());
  EXPECT_FALSE(
      projected_motion_basis(some_pose(), center_ct(), {}, views, Eigen::Vector3d::Zero()));
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
    EXPECT_NEAR(mean_of(brute_force_displacements_mm(points, views, step * PoseVector::Unit(i))),
                1.0,
                kSecondOrder)
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
  // The point does not move in the image along the beam, nor when turned about itself. Its step
  // must stay finite.
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
