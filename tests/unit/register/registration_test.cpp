// SPDX-License-Identifier: Apache-2.0
#include "register/registration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

#include <gtest/gtest.h>

#include "base/error.h"
#include "unit/register/registration_cases.h"

namespace af::registration {
namespace {

/// Mean distance in space between two poses over the phantom's inner lattice.
double mean_distance_mm(const RigidTransform& a, const RigidTransform& b) {
  const std::vector<Eigen::Vector3d> points =
      ct_lattice_points(CtBox{{-20, -20, -20}, {20, 20, 20}}, 4);
  double sum = 0.0;
  for (const Eigen::Vector3d& point : points) sum += (a * point - b * point).norm();
  return sum / static_cast<double>(points.size());
}

/// The search ends within about one final step (0.1 mm of mean projected motion) of the optimum in
/// each of its six parameters, and half of them at random signs: sqrt(6) steps, doubled because a
/// step is a mean over two views and a motion along one view's beam shows in the other only.
constexpr double kFinalStepErrorMm = 2.0 * 2.45 * 0.1;

RigidTransform start_near(const test::SmallCase& small) {
  const PoseFrame about_gold =
      PoseFrame::about(small.gold_room_from_ct, small.problem->center_ct_mm);
  return pose_from_parameters(about_gold,
                              PoseParameters::from_deg_and_mm({-3.0, 2.0, 2.5, -3.0, 2.5, 2.0}));
}

TEST(Registration, TwoViewsRecoverAKnownPose) {
  const test::SmallCase small = test::small_case();
  for (const char* similarity : {"mi", "ncc"}) {
    RegistrationOptions options;
    options.similarity.name = similarity;
    // 1296 pixels per view are few for 64 x 64 bins.
    options.similarity.bins = 24;
    RegistrationRunner runner(small.problem, options);
    const RigidTransform start = start_near(small);
    ASSERT_GT(mean_distance_mm(start, small.gold_room_from_ct), 4.0);
    const RegistrationResult result = runner.run(start);
    EXPECT_EQ(result.stop_reason, StopReason::StepBelowFinal);
    EXPECT_LT(mean_distance_mm(result.room_from_ct, small.gold_room_from_ct), kFinalStepErrorMm)
        << similarity;
    EXPECT_EQ(result.drr_count, 2 * result.evaluations);
    EXPECT_EQ(result.start_room_from_ct.matrix(), start.matrix());
    EXPECT_EQ(result.similarity, runner.similarity_at(result.room_from_ct).similarity);
  }
}

TEST(Registration, TheTraceTellsBothPasses) {
  const test::SmallCase small = test::small_case();
  RegistrationRunner runner(small.problem, RegistrationOptions());
  const RegistrationResult result = runner.run(start_near(small));
  ASSERT_FALSE(result.trace.empty());
  EXPECT_EQ(result.trace.front().pass, 0);
  EXPECT_EQ(result.trace.front().step_mm, 5.0);
  EXPECT_EQ(result.trace.back().pass, 1);
  EXPECT_EQ(result.trace.back().step_mm, 0.1);
  EXPECT_EQ(result.trace.back().evaluations, result.evaluations);
  const RigidTransform last =
      pose_from_parameters(small.problem->frame(), result.trace.back().parameters);
  EXPECT_NEAR(mean_distance_mm(last, result.room_from_ct), 0.0, 1e-9);
  for (std::size_t i = 1; i < result.trace.size(); ++i) {
    if (result.trace[i].pass != result.trace[i - 1].pass) continue;
    EXPECT_GE(result.trace[i].similarity, result.trace[i - 1].similarity);
  }
}

TEST(Registration, RepeatsAndThreadsGiveTheSameBits) {
  const test::SmallCase small = test::small_case();
  RegistrationOptions options;
  options.max_evaluations = 200;
  RegistrationRunner runner(small.problem, options);
  const RegistrationResult first = runner.run(start_near(small));
  EXPECT_EQ(first.stop_reason, StopReason::EvaluationBudgetSpent);
  EXPECT_EQ(first.evaluations, 200);
  (void)runner.run(small.gold_room_from_ct);
  const RegistrationResult again = runner.run(start_near(small));
  RegistrationResult in_thread;
  RegistrationRunner other = runner.share_preparation();
  std::thread thread([&] { in_thread = other.run(start_near(small)); });
  (void)runner.run(small.gold_room_from_ct);
  thread.join();
  for (const RegistrationResult* const result :
       std::initializer_list<const RegistrationResult*>{&again, &in_thread}) {
    EXPECT_EQ(result->room_from_ct.matrix(), first.room_from_ct.matrix());
    EXPECT_EQ(result->similarity, first.similarity);
    EXPECT_EQ(result->trace.size(), first.trace.size());
  }
}

TEST(Registration, AStartOutsideTheMotionRangeIsReported) {
  const test::SmallCase small = test::small_case();
  for (RegistrationView& view : small.problem->views)
    view.limit = MotionLimit{small.problem->frame(), {3.0 * kRadPerDeg, 1.0}};
  RegistrationRunner runner(small.problem, RegistrationOptions());
  const RigidTransform start = start_near(small);
  const RegistrationResult result = runner.run(start);
  EXPECT_EQ(result.stop_reason, StopReason::StartInadmissible);
  EXPECT_EQ(result.room_from_ct.matrix(), start.matrix());
  EXPECT_TRUE(std::isnan(result.similarity));
  EXPECT_EQ(result.evaluations, 1);
  EXPECT_EQ(result.drr_count, 0);
}

TEST(Registration, AnEndAtTheLimitIsReportedAndStaysInside) {
  const test::SmallCase small = test::small_case();
  // The gold pose has |t| = 2.5 mm along x; the box ends at 1.5 mm.
  const MotionLimit limit{small.problem->frame(), {5.0 * kRadPerDeg, 1.5}};
  for (RegistrationView& view : small.problem->views) view.limit = limit;
  RegistrationRunner runner(small.problem, RegistrationOptions());
  const RegistrationResult result = runner.run(small.problem->nominal_room_from_ct);
  EXPECT_EQ(result.stop_reason, StopReason::PinnedAtLimit);
  EXPECT_GT(result.inadmissible, 0);
  EXPECT_TRUE(limit.range.contains(parameters_from_pose(limit.frame, result.room_from_ct)));
}

TEST(Registration, ACtFarFromTheRegionsIsReported) {
  const test::SmallCase small = test::small_case();
  RegistrationRunner runner(small.problem, RegistrationOptions());
  RigidTransform far_away = RigidTransform::Identity();
  far_away.translation() = Eigen::Vector3d(0, 0, 400);
  EXPECT_EQ(runner.run(far_away).stop_reason, StopReason::CtOutsideRoi);
}

TEST(Registration, AMaskedSpotDoesNotMoveTheResult) {
  test::SmallCase small = test::small_case();
  RegistrationOptions options;
  options.similarity.bins = 24;
  for (RegistrationView& view : small.problem->views) {
    view.mask = Image2d(48, 48);
    std::fill(view.mask.pixels.begin(), view.mask.pixels.end(), 1.0f);
    // A marker that the CT does not have. The smoothed reference spreads it, hence the margin.
    for (int row = 20; row < 24; ++row)
      for (int column = 26; column < 30; ++column) view.xray.at(column, row) += 4.0f;
    for (int row = 17; row < 27; ++row)
      for (int column = 23; column < 33; ++column) view.mask.at(column, row) = 0.0f;
  }
  RegistrationRunner runner(small.problem, options);
  const RegistrationResult result = runner.run(start_near(small));
  EXPECT_LT(mean_distance_mm(result.room_from_ct, small.gold_room_from_ct), kFinalStepErrorMm);
}

TEST(RegistrationProblem, NamesEverythingThatIsWrong) {
  const test::SmallCase small = test::small_case();
  small.problem->views[0].xray = Image2d(3, 4);
  small.problem->views[1].view.roi.column = 40;
  small.problem->views[1].mask = Image2d(2, 2);
  small.problem->scaling_points_ct.clear();
  try {
    const RegistrationRunner runner(small.problem, RegistrationOptions());
    FAIL() << "must throw";
  } catch (const InputError& error) {
    const std::string message = error.what();
    for (const char* part : {"view 'AP': X-ray size = 3 x 4: must be the camera's 48 x 48",
                             "view 'LAT': mask size = 2 x 2",
                             "scaling_points_ct"})
      EXPECT_NE(message.find(part), std::string::npos) << part << "\nin " << message;
    EXPECT_NE(message.find("roi"), std::string::npos) << message;
  }
}

TEST(RegistrationOptions, NamesEverythingThatIsWrong) {
  RegistrationOptions options;
  options.similarity.name = "gc";
  options.optimizer = "bobyqa";
  options.passes[0].smoothing_sigma_mm = std::numeric_limits<double>::quiet_NaN();
  options.passes[1].optimizer.final_step_mm = 0.0;
  options.max_evaluations = 0;
  EXPECT_EQ(problems(options).size(), 5U);
  EXPECT_TRUE(problems(RegistrationOptions()).empty());
  EXPECT_TRUE(problems(preset_options("paper")).empty());
  EXPECT_THROW(preset_options("fast"), InputError);
}

}  // namespace
}  // namespace af::registration
