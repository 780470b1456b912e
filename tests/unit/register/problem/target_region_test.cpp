// SPDX-License-Identifier: Apache-2.0
#include "register/problem/target_region.h"

#include <gtest/gtest.h>

#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

/// Seen by small_camera() 625 mm from its source at the nearest: corners 15 mm beside the axis lie
/// 15 * 1000 / 625 / 3 = 8 pixels from the middle, 23.5.
constexpr double kNearestMm = 25.0;
const CtBox kBox{{-15, -kNearestMm, -15}, {15, kNearestMm, 15}};

RegistrationProblem problem_with(const RegionOfInterest& region) {
  RegistrationProblem problem;
  problem.target_box_ct = kBox;
  for (const bool turned : {false, true}) {
    RegistrationView view;
    view.view = {test::small_camera(turned), {1, 2, 3, 4}};
    view.target_region = region;
    problem.views.push_back(view);
  }
  return problem;
}

RigidTransform moved_by(double x, double y, double z) {
  return pose_from_parameters({}, {.translation_mm = {x, y, z}});
}

std::vector<RegionOfInterest> regions_of(const RegistrationProblem& problem,
                                         const RigidTransform& pose,
                                         int step_px = 1) {
  return {region_at(problem, problem.views[0], pose, step_px),
          region_at(problem, problem.views[1], pose, step_px)};
}

using Regions = std::vector<RegionOfInterest>;

TEST(TargetRegion, HoldsTheBoxAndKeepsTheMarginsOfTheStatedRegion) {
  const auto box = projected_box(kBox, RigidTransform::Identity(), test::small_camera(false));
  ASSERT_TRUE(box.has_value());
  EXPECT_LT((box->low_px - Eigen::Vector2d(15.5, 15.5)).norm(), 1e-9);
  EXPECT_LT((box->high_px - Eigen::Vector2d(31.5, 31.5)).norm(), 1e-9);
  // Off the pixels' edges, so that rounding decides nothing.
  const ProjectedBox exact{{15.6, 15.6}, {31.4, 31.4}};
  EXPECT_EQ(target_region_about(exact, RegionOfInterest{6, 7, 36, 30}, true),
            (RegionOfInterest{6, 7, 36, 30}));
  // No margin is below 0: columns 16 to 31 show the box.
  EXPECT_EQ(target_region_about(exact, RegionOfInterest{20, 10, 10, 30}, true),
            (RegionOfInterest{16, 10, 16, 30}));
  // A quarter of 15.8 pixels to every side: 11.65 to 35.35.
  EXPECT_EQ(target_region_about(exact, std::nullopt, true), (RegionOfInterest{12, 12, 24, 24}));
  // Columns 19 to 28 and rows 18 to 29 have their middle at 23.5.
  EXPECT_EQ(target_region_about(exact, RegionOfInterest{0, 0, 10, 12}, false),
            (RegionOfInterest{19, 18, 10, 12}));
}

TEST(TargetRegion, FollowsTheBoxInEveryView) {
  const RegistrationProblem problem = problem_with({16, 17, 16, 15});
  EXPECT_EQ(regions_of(problem, RigidTransform::Identity()),
            (Regions{{16, 17, 16, 15}, {16, 17, 16, 15}}));
  // AP: 0 to 30 mm beside the axis, 0 to 16 pixels. LAT looks along x: from 620 mm before its
  // source rows are 0 to 30 * 1000 / 620 / 3 = 16.1 pixels up.
  const RigidTransform pose = moved_by(15, 0, 15);
  EXPECT_EQ(regions_of(problem, pose), (Regions{{24, 9, 16, 15}, {16, 9, 16, 15}}));
  EXPECT_EQ(regions_of(problem, pose, 3), (Regions{{25, 8, 16, 15}, {16, 8, 16, 15}}));
  EXPECT_EQ(regions_of(problem, pose, 20), regions_of(problem, RigidTransform::Identity()));
  const std::vector<View> views = views_at(problem, pose);
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[1].camera.name, "LAT");
  EXPECT_EQ(views[1].roi, (RegionOfInterest{16, 9, 16, 15}));
}

TEST(TargetRegion, ReachesBeyondTheDetectorButItsMiddleStaysOnIt) {
  const RegistrationProblem wide = problem_with({6, 6, 36, 36});
  EXPECT_EQ(regions_of(wide, moved_by(15, 0, 15)), (Regions{{14, -2, 36, 36}, {6, -2, 36, 36}}));
  EXPECT_EQ(views_at(wide, moved_by(15, 0, 15))[0].roi, (RegionOfInterest{14, 0, 34, 34}));
  const RegistrationProblem small = problem_with({16, 16, 16, 16});
  EXPECT_EQ(regions_of(small, moved_by(300, 0, 0))[0], (RegionOfInterest{40, 16, 16, 16}));
  EXPECT_EQ(regions_of(small, moved_by(-300, 0, 0))[0], (RegionOfInterest{-8, 16, 16, 16}));
  EXPECT_EQ(regions_of(small, moved_by(0, -640, 0))[0], (RegionOfInterest{16, 16, 16, 16}))
      << "behind the source";
}

TEST(TargetRegion, OfAViewThatDoesNotFollowIsTheStudys) {
  RegistrationProblem problem = problem_with({16, 16, 16, 16});
  problem.views[1].target_region.reset();
  EXPECT_EQ(regions_of(problem, moved_by(15, 0, 15))[1], (RegionOfInterest{1, 2, 3, 4}));
}

}  // namespace
}  // namespace af::registration
