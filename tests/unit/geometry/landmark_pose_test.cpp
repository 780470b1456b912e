// SPDX-License-Identifier: Apache-2.0
#include "geometry/landmark_pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "unit/geometry/camera_at.h"

namespace af {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using test::camera_at;
using testing::HasSubstr;

// The search stops when steps are below 1e-9 of a radian or millimetre; one view leaves the depth
// weakly fixed: about 100 times more.
constexpr double kSearchMm = 1e-5;

const std::vector<Vector3d> kLandmarks = {
    {-60, 10, 5}, {55, -20, 12}, {8, 70, -40}, {-15, -35, 66}, {30, 25, 48}};

std::vector<CameraGeometry> two_cameras() {
  return {camera_at("A", {0, -650, 0}, Vector3d::UnitX()),
          camera_at("B", {650, 0, 0}, Vector3d::UnitY())};
}

/// What cameras see at a pose: the first `count` landmarks each.
std::vector<LandmarkView> seen(const std::vector<CameraGeometry>& cameras,
                               const RigidTransform& pose,
                               std::size_t count) {
  std::vector<LandmarkView> views;
  for (const CameraGeometry& camera : cameras) {
    LandmarkView view{camera, {}};
    for (std::size_t i = 0; i < kLandmarks.size(); ++i)
      view.landmarks_px.push_back(i < count ? std::optional(camera.project(pose * kLandmarks[i]))
                                            : std::nullopt);
    views.push_back(view);
  }
  return views;
}

/// Far from nominal, with rotations that a wrong guess may have.
RigidTransform far_pose(int index) {
  const std::array<std::array<double, 6>, 5> values = {{{170, -60, 95, 8, -12, 20},
                                                        {-90, 0, 180, 0, 0, 0},
                                                        {30, 80, -140, -15, 10, -25},
                                                        {0, 0, 179, 5, 5, 5},
                                                        {10, -8, 6, 12, -20, 30}}};
  return pose_from_parameters(
      PoseFrame(), PoseParameters::from_deg_and_mm(values.at(static_cast<std::size_t>(index))));
}

double largest_distance(const RigidTransform& a, const RigidTransform& b) {
  double largest = 0.0;
  for (const Vector3d& point : kLandmarks)
    largest = std::max(largest, (a * point - b * point).norm());
  return largest;
}

TEST(LandmarkPose, OfTwoViewsAndThreePointsIsTheTrueOneFromAnyNominal) {
  for (int i = 0; i < 5; ++i) {
    const LandmarkPose pose = pose_from_landmarks(
        seen(two_cameras(), far_pose(i), 3), kLandmarks, RigidTransform::Identity());
    EXPECT_LT(largest_distance(pose.room_from_ct, far_pose(i)), kSearchMm) << i;
    EXPECT_EQ(pose.residuals.size(), 6U);
    EXPECT_LT(pose.rms_px, 1e-6);
    EXPECT_TRUE(pose.notes.empty());
  }
}

TEST(LandmarkPose, OfOneViewAndFourPointsIsTheTrueOne) {
  const std::vector<CameraGeometry> one = {two_cameras().front()};
  for (int i = 0; i < 5; ++i) {
    const LandmarkPose pose =
        pose_from_landmarks(seen(one, far_pose(i), 5), kLandmarks, RigidTransform::Identity());
    EXPECT_LT(largest_distance(pose.room_from_ct, far_pose(i)), 100 * kSearchMm) << i;
  }
}

TEST(LandmarkPose, OfOneViewAndThreePointsTakesThePoseNearestToNominalAndSaysSo) {
  const std::vector<CameraGeometry> one = {two_cameras().front()};
  const RigidTransform truth = far_pose(4);
  const RigidTransform nominal =
      pose_from_parameters(PoseFrame::about(truth, Vector3d::Zero()),
                           PoseParameters::from_deg_and_mm({2, -3, 2, 5, 5, 5}));
  const LandmarkPose pose = pose_from_landmarks(seen(one, truth, 3), kLandmarks, nominal);
  EXPECT_LT(largest_distance(pose.room_from_ct, truth), 100 * kSearchMm);
  ASSERT_EQ(pose.notes.size(), 1U);
  EXPECT_THAT(pose.notes[0], HasSubstr("turned least from the nominal pose"));
}

// A landmark may be seen in one view only: three in A, two of them and a fourth in B.
TEST(LandmarkPose, UsesEveryLandmarkOfEveryView) {
  const RigidTransform truth = far_pose(2);
  std::vector<LandmarkView> views = seen(two_cameras(), truth, 4);
  views[0].landmarks_px[3] = std::nullopt;
  views[1].landmarks_px[0] = std::nullopt;
  views[1].landmarks_px[1] = std::nullopt;
  const LandmarkPose pose = pose_from_landmarks(views, kLandmarks, RigidTransform::Identity());
  EXPECT_EQ(pose.residuals.size(), 5U);
  EXPECT_LT(largest_distance(pose.room_from_ct, truth), kSearchMm);
}

// Misses of 1.5 pixels of 0.4 mm at a magnification of 1.5: about 0.4 mm in the room, less after
// averaging over five points and two views. Residuals: twenty numbers of which six are fitted.
TEST(LandmarkPose, ClicksThatMissMoveThePoseByAsMuchAsTheyMiss) {
  const RigidTransform truth = far_pose(4);
  std::vector<LandmarkView> views = seen(two_cameras(), truth, 5);
  HashRandom random(7);
  for (LandmarkView& view : views)
    for (auto& point : view.landmarks_px)
      *point += 1.5 * Vector2d(random.normal(), random.normal());
  const LandmarkPose pose = pose_from_landmarks(views, kLandmarks, RigidTransform::Identity());
  EXPECT_LT(largest_distance(pose.room_from_ct, truth), 1.5);
  EXPECT_GT(pose.rms_px, 0.7);
  EXPECT_LT(pose.rms_px, 3.0);
  EXPECT_NEAR(pose.rms_mm, pose.rms_px * 0.4 / 1.5, 0.15 * pose.rms_mm);
}

TEST(LandmarkPose, AClickOnAnotherLandmarkShowsInItsResiduals) {
  std::vector<LandmarkView> views = seen(two_cameras(), far_pose(4), 5);
  std::swap(views[1].landmarks_px[0], views[1].landmarks_px[1]);
  const LandmarkPose pose = pose_from_landmarks(views, kLandmarks, RigidTransform::Identity());
  EXPECT_GT(pose.rms_px, 20.0);
}

TEST(LandmarkPose, TooFewOrDegenerateLandmarksAreRefused) {
  const auto refused = [](const std::vector<LandmarkView>& views, const std::vector<Vector3d>& ct) {
    EXPECT_THROW(pose_from_landmarks(views, ct, RigidTransform::Identity()), InputError);
  };
  refused(seen(two_cameras(), far_pose(4), 2), kLandmarks);
  refused(seen(two_cameras(), far_pose(4), 5), {kLandmarks[0], kLandmarks[1]});
  const std::vector<Vector3d> line = {{0, 0, 0}, {10, 1, 2}, {20, 2, 4}, {30, 3, 6}, {50, 5, 10}};
  refused(seen(two_cameras(), far_pose(4), 5), line);
  refused({}, kLandmarks);
}

}  // namespace
}  // namespace af
