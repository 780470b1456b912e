// SPDX-License-Identifier: Apache-2.0
// Leave-one-out errors and the gold standard's own uncertainty against hand-computed and simulated
// answers.
#include "geometry/gold_uncertainty.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "unit/geometry/camera_at.h"

namespace af {
namespace {

using Eigen::Vector3d;
using test::camera_at;

const std::vector<Vector3d> kFiducials = {{20, 5, -8}, {-25, 10, 3}, {4, -22, 18}, {-6, 14, -20}};

RigidTransform true_pose() {
  return pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm({5, -3, 8, 4, -6, 2}));
}

/// Detections of the fiducials at the true pose with normal errors.
std::vector<FiducialView> noisy_views(double sigma_px, std::uint64_t key) {
  HashRandom random(11, key);
  std::vector<FiducialView> views = {{camera_at("A", {0, -650, 0}, Vector3d::UnitX()), {}},
                                     {camera_at("B", {650, 0, 0}, Vector3d::UnitY()), {}}};
  for (FiducialView& view : views)
    for (const Vector3d& point : kFiducials)
      view.fiducials_px.push_back(view.camera.project(true_pose() * point) +
                                  sigma_px * Eigen::Vector2d(random.normal(), random.normal()));
  return views;
}

GoldUncertainty uncertainty_of(const std::vector<FiducialView>& views,
                               std::uint64_t seed,
                               std::size_t replicates) {
  return gold_uncertainty(gold_from_fiducials(views, kFiducials),
                          views,
                          kFiducials,
                          target_points({{-30, -30, -30}, {30, 30, 30}}, 15.0),
                          seed,
                          replicates);
}

TEST(LeaveOneOut, OfHandComputedCases) {
  // The other three points of a square fit exactly; the one that was moved misses by its move.
  const std::vector<Vector3d> source = {{10, 10, 0}, {10, -10, 0}, {-10, 10, 0}, {-10, -10, 0}};
  std::vector<Vector3d> target = source;
  target[3] += Vector3d(0, 0, 5);
  const std::vector<double> errors_mm = leave_one_out_errors_mm(target, source);
  ASSERT_EQ(errors_mm.size(), 4u);
  // Double rounding of coordinates of 10 mm through an SVD.
  EXPECT_NEAR(errors_mm[3], 5.0, 1e-12);
  // Predictions from sets with the moved point are off, too, and no fit hides that. So
  // leave-one-out errors exceed the residuals of the fit to all.
  const RigidFit fit = fit_rigid(target, source);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_GT(errors_mm[i], fit.residuals_mm[i]) << i;
}

TEST(LeaveOneOut, DoesNotExistWhereTheOthersFixNoPose) {
  const std::vector<Vector3d> three = {{0, 0, 0}, {10, 0, 0}, {0, 10, 0}};
  EXPECT_THAT(leave_one_out_errors_mm(three, three), testing::IsEmpty());
  // Without its corner this one is a line.
  const std::vector<Vector3d> line_and_corner = {{0, 0, 0}, {10, 0, 0}, {20, 0, 0}, {0, 10, 0}};
  EXPECT_THAT(leave_one_out_errors_mm(line_and_corner, line_and_corner), testing::IsEmpty());
}

TEST(LeaveOneOut, OfExactFiducialsIsZero) {
  const FiducialGold gold = gold_from_fiducials(noisy_views(0.0, 0), kFiducials);
  ASSERT_EQ(gold.leave_one_out_mm.size(), 4u);
  // Rounding as in the fit itself (fiducial_registration_test.cpp).
  for (const double error_mm : gold.leave_one_out_mm) EXPECT_LT(error_mm, 1e-8);
}

TEST(GoldUncertainty, OfExactFiducialsIsZero) {
  const GoldUncertainty result = uncertainty_of(noisy_views(0.0, 0), 1, 10);
  EXPECT_EQ(result.degrees_of_freedom, 2u * 2u * 4u - 6u);
  EXPECT_LT(result.detection_sigma_px, 1e-8);
  EXPECT_LT(result.p95_tre_mm, 1e-8);
}

TEST(GoldUncertainty, CountsOnlyWhatViewsShow) {
  std::vector<FiducialView> views = noisy_views(0.2, 3);
  views.push_back({camera_at("C", {460, -460, 0}, Vector3d(1, 1, 0).normalized()), {}});
  for (const Vector3d& point : kFiducials)
    views[2].fiducials_px.push_back(views[2].camera.project(true_pose() * point));
  EXPECT_EQ(uncertainty_of(views, 1, 5).degrees_of_freedom, 2u * 3u * 4u - 6u);
  views[2].fiducials_px[0] = hidden_fiducial_px();
  EXPECT_EQ(uncertainty_of(views, 1, 5).degrees_of_freedom, 2u * (3u * 4u - 1u) - 6u);
  // Fiducial 1 is left in one view only, so its detection there says nothing either.
  views[0].fiducials_px[1] = views[1].fiducials_px[1] = hidden_fiducial_px();
  const GoldUncertainty result = uncertainty_of(views, 1, 20);
  EXPECT_EQ(result.degrees_of_freedom, 2u * (3u * 3u - 1u) - 6u);
  EXPECT_TRUE(std::isfinite(result.mean_tre_mm));
  EXPECT_GT(result.detection_sigma_px, 0.0);
}

TEST(GoldUncertainty, DependsOnItsArgumentsAlone) {
  const std::vector<FiducialView> views = noisy_views(0.2, 3);
  EXPECT_EQ(uncertainty_of(views, 1, 20).mean_tre_mm, uncertainty_of(views, 1, 20).mean_tre_mm);
  EXPECT_NE(uncertainty_of(views, 1, 20).mean_tre_mm, uncertainty_of(views, 2, 20).mean_tre_mm);
}

TEST(GoldUncertainty, GrowsInProportionToTheResiduals) {
  const std::vector<FiducialView> exact = noisy_views(0.0, 4);
  std::vector<FiducialView> near = noisy_views(0.1, 4);
  std::vector<FiducialView> far = noisy_views(0.2, 4);
  const GoldUncertainty small = uncertainty_of(near, 1, 50);
  const GoldUncertainty large = uncertainty_of(far, 1, 50);
  // Everything is linear in errors of 0.2 px, which are 0.04 degrees over fiducials 25 mm from
  // their centre. Only their square, 1e-3 of them, and the changed pose that they are measured at
  // are not.
  constexpr double kNonlinearShare = 0.01;
  EXPECT_NEAR(large.detection_sigma_px / small.detection_sigma_px, 2.0, 2 * kNonlinearShare);
  EXPECT_NEAR(large.rms_tre_mm / small.rms_tre_mm, 2.0, 2 * kNonlinearShare);
}

TEST(GoldUncertainty, EqualsTheTrueErrorOfSimulatedGoldStandards) {
  constexpr double kSigmaPx = 0.2;
  constexpr std::uint64_t kStudies = 400;
  const std::vector<Vector3d> target = target_points({{-30, -30, -30}, {30, 30, 30}}, 15.0);
  double true_squares = 0.0;
  double told_squares = 0.0;
  double variance_px2 = 0.0;
  int below_p95 = 0;
  for (std::uint64_t study = 0; study < kStudies; ++study) {
    const std::vector<FiducialView> views = noisy_views(kSigmaPx, 100 + study);
    const double true_tre_mm =
        mean_tre_mm(gold_from_fiducials(views, kFiducials).room_from_ct, true_pose(), target);
    const GoldUncertainty told = uncertainty_of(views, study, 60);
    true_squares += true_tre_mm * true_tre_mm;
    told_squares += told.rms_tre_mm * told.rms_tre_mm;
    variance_px2 += told.detection_sigma_px * told.detection_sigma_px;
    below_p95 += true_tre_mm <= told.p95_tre_mm ? 1 : 0;
  }
  constexpr auto kCount = static_cast<double>(kStudies);
  // An estimate with 10 degrees of freedom has a relative variance of 2/10, its mean over 400
  // studies a standard error of sqrt(0.2 / 400) = 0.022; four of these. The two-step fit leaves
  // residuals a little larger than least squares in the images would: at most that much again.
  EXPECT_NEAR(variance_px2 / kCount / (kSigmaPx * kSigmaPx), 1.05, 0.14);
  // The squared TRE of six parameters has a relative variance of some 2/3 (a sum of about three
  // equal squares): 0.041, and the estimate's 0.022: together 0.047; three of these.
  EXPECT_NEAR(told_squares / true_squares, 1.05, 0.19);
  // With sigma known to 22 % only, an upper limit at 95 % holds less often, as a normal quantile
  // does beside Student's: 91 % for 10 degrees of freedom. Five standard errors of 0.014 and the
  // spread of the 95th percentile of 60 replicates.
  EXPECT_NEAR(below_p95 / kCount, 0.91, 0.08);
}

TEST(GoldUncertainty, NeedsTargetPoints) {
  const std::vector<FiducialView> views = noisy_views(0.2, 1);
  EXPECT_THROW(gold_uncertainty(gold_from_fiducials(views, kFiducials), views, kFiducials, {}, 1),
               InputError);
}

}  // namespace
}  // namespace af
