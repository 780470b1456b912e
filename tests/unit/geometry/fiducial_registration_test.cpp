// SPDX-License-Identifier: Apache-2.0
#include "geometry/fiducial_registration.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "unit/geometry/camera_at.h"

namespace af {
namespace {

using Eigen::Vector3d;
using test::camera_at;

// Values up to 1000 mm, a few dozen double operations: 1e3 * 2.2e-16 * 100 is 2e-11; the normal
// matrix's condition number (at most 1e2 here) multiplies it.
constexpr double kRoundingMm = 1e-8;

Ray ray_between(const Vector3d& from, const Vector3d& through) {
  return {from, (through - from).normalized()};
}

TEST(BackProjection, OfSkewRaysIsTheMidpointOfTheShortestSegment) {
  // Along x at z = 0 and along y at z = 3: the shortest segment joins (0, 0, 0) and (0, 0, 3).
  const std::vector<Ray> rays = {{{-100, 0, 0}, Vector3d::UnitX()},
                                 {{0, -50, 3}, Vector3d::UnitY()}};
  const BackProjection point = back_project(rays);
  EXPECT_LT((point.room_point - Vector3d(0, 0, 1.5)).norm(), kRoundingMm);
  EXPECT_NEAR(point.ray_gap_mm, 3.0, kRoundingMm);
}

TEST(BackProjection, OfObliqueSkewRaysIsTheMidpointOfTheShortestSegment) {
  // Closed form for lines o1 + s d1 and o2 + t d2.
  const Ray a = ray_between({650, 20, -400}, {3, 4, 5});
  const Ray b = ray_between({-500, 30, -450}, {2, 6, 4});
  const Vector3d w = a.origin_point - b.origin_point;
  const double ab = a.direction.dot(b.direction);
  const double s = (ab * b.direction.dot(w) - a.direction.dot(w)) / (1 - ab * ab);
  const double t = (b.direction.dot(w) - ab * a.direction.dot(w)) / (1 - ab * ab);
  const Vector3d on_a = a.origin_point + s * a.direction;
  const Vector3d on_b = b.origin_point + t * b.direction;
  const BackProjection point = back_project(std::vector<Ray>{a, b});
  EXPECT_LT((point.room_point - (on_a + on_b) / 2).norm(), kRoundingMm);
  EXPECT_NEAR(point.ray_gap_mm, (on_a - on_b).norm(), kRoundingMm);
  EXPECT_GT(point.ray_gap_mm, 0.1);
}

TEST(BackProjection, OfThreeRaysThroughOnePointIsThatPoint) {
  const Vector3d truth(1, -2, 30);
  const std::vector<Ray> rays = {ray_between({600, 0, 0}, truth),
                                 ray_between({0, 600, 10}, truth),
                                 ray_between({-300, 20, -600}, truth)};
  const BackProjection point = back_project(rays);
  EXPECT_LT((point.room_point - truth).norm(), kRoundingMm);
  EXPECT_LT(point.ray_gap_mm, kRoundingMm);
}

TEST(BackProjection, RefusesRaysThatFixNoPoint) {
  const Ray a = {{0, 0, 0}, Vector3d::UnitX()};
  const Ray almost_parallel = ray_between({0, 10, 0}, {1000, 15, 0});  // 0.3 degrees
  EXPECT_THROW(back_project(std::vector<Ray>{a}), InputError);
  EXPECT_THROW(back_project(std::vector<Ray>{a, almost_parallel}), InputError);
}

TEST(BackProjection, RefusesPointsBehindASource) {
  const std::vector<Ray> rays = {{{10, 0, 0}, Vector3d::UnitX()}, {{0, -50, 0}, Vector3d::UnitY()}};
  EXPECT_THROW(back_project(rays), InputError);
}

std::vector<Vector3d> transformed(const RigidTransform& map, const std::vector<Vector3d>& points) {
  std::vector<Vector3d> result;
  for (const Vector3d& point : points) result.push_back(map * point);
  return result;
}

TEST(RigidFit, RecoversAKnownPoseFromFourPoints) {
  const PoseFrame frame;
  const RigidTransform truth =
      pose_from_parameters(frame, PoseParameters::from_deg_and_mm({40, -70, 160, 12, -340, 56}));
  const std::vector<Vector3d> source = {{0, 0, 0}, {80, 0, 5}, {0, 60, -10}, {30, 20, 70}};
  const RigidFit fit = fit_rigid(transformed(truth, source), source);
  EXPECT_TRUE(fit.target_from_source.isApprox(truth, kRoundingMm));
  EXPECT_LT(fit.fre_mm, kRoundingMm);
}

TEST(RigidFit, ReportsHandComputedResiduals) {
  // A square whose corners are moved outwards along x by 1 mm at +x and -x alike: the best pose is
  // the identity by symmetry, every residual is 1 mm.
  const std::vector<Vector3d> source = {{10, 10, 0}, {10, -10, 0}, {-10, 10, 0}, {-10, -10, 0}};
  const std::vector<Vector3d> target = {{11, 10, 0}, {11, -10, 0}, {-11, 10, 0}, {-11, -10, 0}};
  const RigidFit fit = fit_rigid(target, source);
  EXPECT_TRUE(fit.target_from_source.isApprox(RigidTransform::Identity(), kRoundingMm));
  for (const double residual : fit.residuals_mm) EXPECT_NEAR(residual, 1.0, kRoundingMm);
  EXPECT_NEAR(fit.fre_mm, 1.0, kRoundingMm);
}

TEST(RigidFit, NeverReturnsAReflection) {
  // Nearly planar points with noise across the plane, and a mirrored target: the unguarded solution
  // is a reflection for these.
  int reflections_prevented = 0;
  for (std::uint64_t draw = 0; draw < 200; ++draw) {
    HashRandom random(7, draw);
    std::vector<Vector3d> source;
    std::vector<Vector3d> target;
    for (int i = 0; i < 4; ++i) {
      const Vector3d point(random.uniform(-50, 50), random.uniform(-50, 50), 0.5 * random.normal());
      source.push_back(point);
      target.emplace_back(point.x(), point.y(), -point.z());
    }
    const RigidFit fit = fit_rigid(target, source);
    EXPECT_NEAR(fit.target_from_source.linear().determinant(), 1.0, kRoundingMm) << draw;
    // A reflection would fit exactly.
    if (fit.fre_mm > 1e-3) ++reflections_prevented;
  }
  EXPECT_GT(reflections_prevented, 150);
}

TEST(RigidFit, RefusesPointsThatFixNoRotation) {
  const std::vector<Vector3d> line = {{0, 0, 0}, {10, 20, 30}, {20, 40, 60}, {-5, -10, -15}};
  const std::vector<Vector3d> plane = {{0, 0, 0}, {10, 0, 0}, {0, 10, 0}, {10, 10, 0}};
  const std::vector<Vector3d> one_spot(4, Vector3d(1, 2, 3));
  EXPECT_THROW(fit_rigid(plane, line), InputError);
  EXPECT_THROW(fit_rigid(line, plane), InputError);
  EXPECT_THROW(fit_rigid(one_spot, one_spot), InputError);
  EXPECT_THROW(fit_rigid(std::span(plane).first(2), std::span(plane).first(2)), InputError);
  EXPECT_THROW(fit_rigid(plane, std::span(plane).first(3)), InputError);
  std::vector<Vector3d> with_nan = plane;
  with_nan[2].y() = std::nan("");
  EXPECT_THROW(fit_rigid(with_nan, plane), InputError);
}

/// Five fiducials as two or three cameras see them at a pose.
struct SeenFiducials {
  RigidTransform truth =
      pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm({5, -3, 8, 4, -6, 2}));
  std::vector<Vector3d> ct_mm = {
      {20, 5, -8}, {-25, 10, 3}, {4, -22, 18}, {-6, 14, -20}, {15, -18, -4}};
  std::vector<FiducialView> views = {
      {camera_at("A", {0, -650, 0}, Vector3d::UnitX()), {}},
      {camera_at("B", {650, 0, 0}, Vector3d::UnitY()), {}},
      {camera_at("C", {460, -460, 0}, Vector3d(1, 1, 0).normalized()), {}}};

  SeenFiducials() {
    for (FiducialView& view : views)
      for (const Vector3d& point : ct_mm)
        view.fiducials_px.push_back(view.camera.project(truth * point));
  }
};

TEST(FiducialGold, IsMadeFromThoseThatTwoViewsShow) {
  SeenFiducials seen;
  // Fiducial 0 in all, 1 in A and C, 2 in B alone, 3 in A and B, 4 in B and C.
  seen.views[0].fiducials_px[2] = hidden_fiducial_px();
  seen.views[2].fiducials_px[2] = hidden_fiducial_px();
  seen.views[1].fiducials_px[1] = hidden_fiducial_px();
  seen.views[2].fiducials_px[3] = hidden_fiducial_px();
  seen.views[0].fiducials_px[4] = hidden_fiducial_px();
  // Where one view alone shows it, a fiducial has no say, however wrong it is.
  seen.views[1].fiducials_px[2] += Eigen::Vector2d(40, -30);
  const FiducialGold gold = gold_from_fiducials(seen.views, seen.ct_mm);
  EXPECT_EQ(gold.used, (std::vector<std::size_t>{0, 1, 3, 4}));
  EXPECT_TRUE(gold.room_from_ct.isApprox(seen.truth, kRoundingMm));
  EXPECT_EQ(gold.back_projections.size(), 4u);
  EXPECT_EQ(gold.fit.residuals_mm.size(), 4u);
  EXPECT_EQ(gold.leave_one_out_mm.size(), 4u);
  for (const double error_mm : gold.leave_one_out_mm) EXPECT_LT(error_mm, kRoundingMm);
}

TEST(FiducialGold, OfAHiddenFiducialEqualsThatOfAStudyWithoutIt) {
  SeenFiducials seen;
  // Noise keeps the fit from being exact.
  HashRandom random(3, 1);
  for (FiducialView& view : seen.views)
    for (Eigen::Vector2d& point : view.fiducials_px)
      point += Eigen::Vector2d(random.normal(), random.normal());
  SeenFiducials without = seen;
  for (FiducialView& view : seen.views) view.fiducials_px[2] = hidden_fiducial_px();
  for (FiducialView& view : without.views) view.fiducials_px.erase(view.fiducials_px.begin() + 2);
  without.ct_mm.erase(without.ct_mm.begin() + 2);
  const FiducialGold gold = gold_from_fiducials(seen.views, seen.ct_mm);
  const FiducialGold expected = gold_from_fiducials(without.views, without.ct_mm);
  EXPECT_EQ(gold.room_from_ct.matrix(), expected.room_from_ct.matrix());
  EXPECT_EQ(gold.fit.fre_mm, expected.fit.fre_mm);
  EXPECT_GT(gold.fit.fre_mm, 0.01);
}

TEST(FiducialGold, NeedsThreeThatTwoViewsShow) {
  SeenFiducials seen;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t view = 1; view < 3; ++view)
      seen.views[view].fiducials_px[i] = hidden_fiducial_px();
  EXPECT_EQ(fiducials_in_two_views(seen.views, 5), (std::vector<std::size_t>{3, 4}));
  EXPECT_THROW(gold_from_fiducials(seen.views, seen.ct_mm), InputError);
  EXPECT_TRUE(fiducials_in_two_views({}, 5).empty());
}

TEST(FiducialGold, RecoversThePoseThatProjectedTheFiducials) {
  const RigidTransform truth =
      pose_from_parameters(PoseFrame{}, PoseParameters::from_deg_and_mm({5, -3, 8, 4, -6, 2}));
  const std::vector<Vector3d> fiducials = {{20, 5, -8}, {-25, 10, 3}, {4, -22, 18}, {-6, 14, -20}};
  std::vector<FiducialView> views = {{camera_at("A", {0, -650, 0}, Vector3d::UnitX()), {}},
                                     {camera_at("B", {650, 0, 0}, Vector3d::UnitY()), {}}};
  for (FiducialView& view : views)
    for (const Vector3d& point : fiducials)
      view.fiducials_px.push_back(view.camera.project(truth * point));
  const FiducialGold gold = gold_from_fiducials(views, fiducials);
  EXPECT_TRUE(gold.room_from_ct.isApprox(truth, kRoundingMm));
  EXPECT_LT(gold.fit.fre_mm, kRoundingMm);
  for (const BackProjection& point : gold.back_projections)
    EXPECT_LT(point.ray_gap_mm, kRoundingMm);

  views[1].fiducials_px.pop_back();
  EXPECT_THROW(gold_from_fiducials(views, fiducials), InputError);
}

}  // namespace
}  // namespace af
