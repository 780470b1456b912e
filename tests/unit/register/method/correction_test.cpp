// SPDX-License-Identifier: Apache-2.0
#include "register/method/correction.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "geometry/tre.h"
#include "register/method/presets.h"
#include "register/verdict/registration.h"
#include "unit/register/method/narrow_drr.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

/// Ray casting with an error like a field's: an image that moves with the detector, not the CT.
class SpoiltDrr final : public DrrRenderer {
 public:
  explicit SpoiltDrr(std::shared_ptr<const DrrRenderer> renderer)
      : renderer_(std::move(renderer)) {}

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients) const override {
    const RenderStatus status =
        renderer_->render(room_from_ct, view, workspace, total_attenuation, gradients);
    const double wave = 2.0 * 3.14159 / (0.37 * view.roi.width);
    for (int row = 0; row < view.roi.height; ++row)
      for (int column = 0; column < view.roi.width; ++column)
        total_attenuation[static_cast<std::size_t>(row * view.roi.width + column)] +=
            0.15f * static_cast<float>(std::sin(wave * (column + 0.6 * row)));
    return status;
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return renderer_->make_workspace();
  }
  [[nodiscard]] const char* name() const override { return "field"; }

 private:
  std::shared_ptr<const DrrRenderer> renderer_;
};

/// The small case by look-up with an error, ray casting beside it.
test::SmallCase spoilt_case() {
  test::SmallCase small = test::small_case();
  small.problem->target_points_ct = ct_lattice_points(CtBox{{-20, -20, -20}, {20, 20, 20}}, 4);
  for (RegistrationView& view : small.problem->views) {
    view.ray_casts = {view.renderer};
    view.renderer = std::make_shared<const SpoiltDrr>(view.renderer);
  }
  return small;
}

RegistrationOptions one_stage(const std::string& similarity, const std::string& optimizer) {
  RegistrationOptions options = preset_options("paper");
  StageOptions stage;
  stage.similarity.name = similarity;
  stage.similarity.bins = 24;
  stage.optimizer = optimizer;
  stage.search = {2.0, 0.02, 16};
  options.chains = {{"one", {stage}}};
  return options;
}

RegistrationOptions corrected(RegistrationOptions options) {
  options.correction.is_wanted = true;
  return options;
}

RigidTransform start_near_gold(const test::SmallCase& small) {
  const PoseFrame about_gold =
      PoseFrame::about(small.gold_room_from_ct, small.problem->center_ct_mm);
  return pose_from_parameters(about_gold,
                              PoseParameters::from_deg_and_mm({-1.0, 0.5, 0.8, -1.0, 0.7, 0.6}));
}

double distance_mm(const test::SmallCase& small, const RigidTransform& a, const RigidTransform& b) {
  return mean_tre_mm(a, b, small.problem->target_points_ct);
}

struct PlainAndBetter {
  RegistrationResult plain;
  RegistrationResult better;
};

/// Without and with a correction, which must end better by ray casting.
PlainAndBetter plain_and_better(const test::SmallCase& small, const RegistrationOptions& options) {
  const RegistrationResult plain =
      Registration(small.problem, options).search(start_near_gold(small));
  const RegistrationResult better =
      Registration(small.problem, corrected(options)).search(start_near_gold(small));
  Registration by_ray_casting(test::small_case().problem, options);
  EXPECT_GT(by_ray_casting.similarity_at(better.room_from_ct).similarity,
            by_ray_casting.similarity_at(plain.room_from_ct).similarity);
  return {plain, better};
}

/// X-rays are this ray caster's DRRs at the gold pose, which is therefore its optimum for every
/// measure. Gauss-Newton ends within a final step of 0.02 mm of it along each of six directions. A
/// motion along one view's beam, seen by the other view alone, doubles that.
constexpr double kGaussNewtonErrorMm = 2.0 * 2.45 * 0.02;

TEST(Correction, OfAnImageThatStaysEndsBetterByEveryMeasureAndWhereRayCastingDoes) {
  const test::SmallCase small = spoilt_case();
  for (const std::string& similarity : similarity_names()) {
    SCOPED_TRACE(similarity);
    const bool has_squares = known_measure(similarity).is_least_squares;
    RegistrationOptions options =
        one_stage(similarity, has_squares ? "gauss-newton" : "best-neighbor");
    const auto [plain, better] = plain_and_better(small, options);
    if (has_squares) {
      EXPECT_LT(distance_mm(small, better.room_from_ct, small.gold_room_from_ct),
                kGaussNewtonErrorMm);
      EXPECT_GT(distance_mm(small, plain.room_from_ct, small.gold_room_from_ct),
                2.0 * kGaussNewtonErrorMm);
    }
    EXPECT_FALSE(plain.correction.has_value());
    ASSERT_TRUE(better.correction.has_value());
    EXPECT_GE(better.correction->casts, 1);
    EXPECT_NEAR(better.correction->moved_mm,
                distance_mm(small, plain.room_from_ct, better.room_from_ct),
                1e-9);
    EXPECT_GT(better.drr_count, plain.drr_count);
    EXPECT_EQ(better.correction->stood_still,
              better.correction->casts < options.correction.max_casts);
  }
}

TEST(Correction, IsOfAnyOptimiserAndTheSearchThatItDoesByRayCasting) {
  const test::SmallCase small = spoilt_case();
  for (const std::string& optimizer : optimizer_names()) {
    SCOPED_TRACE(optimizer);
    RegistrationOptions options = one_stage("ncc", optimizer);
    const bool has_derivatives = known_optimizer(optimizer).needs() != Derivatives::None;
    if (!has_derivatives) options.chains.front().stages.front().search.final_step_mm = 0.1;
    options.correction.max_casts = 1000;
    const auto [plain, better] = plain_and_better(small, options);
    EXPECT_TRUE(better.correction->stood_still);
    // Derivatives save casts.
    if (has_derivatives) {
      EXPECT_LE(better.correction->casts, 6);
      EXPECT_LT(distance_mm(small, better.room_from_ct, small.gold_room_from_ct),
                2.0 * options.correction.tolerance_mm);
    }
  }
}

TEST(Correction, EndsWhenThePoseStandsStillOrItsCastsAreSpent) {
  const test::SmallCase small = spoilt_case();
  RegistrationOptions options = corrected(one_stage("ncc", "gauss-newton"));
  options.correction.max_casts = 20;
  const CorrectionReport still =
      *Registration(small.problem, options).search(start_near_gold(small)).correction;
  EXPECT_TRUE(still.stood_still);
  EXPECT_LE(still.last_mm, options.correction.tolerance_mm);
  EXPECT_LT(still.casts, 20);
  options.correction.max_casts = 1;
  const CorrectionReport once =
      *Registration(small.problem, options).search(start_near_gold(small)).correction;
  EXPECT_EQ(once.casts, 1);
  EXPECT_FALSE(once.stood_still);
  EXPECT_EQ(once.last_mm, once.moved_mm);
}

TEST(Correction, LeavesAnEndThatDidNotConverge) {
  const test::SmallCase small = spoilt_case();
  RegistrationOptions options = one_stage("ncc", "gauss-newton");
  options.max_evaluations = 3;
  const RegistrationResult plain =
      Registration(small.problem, options).search(start_near_gold(small));
  const RegistrationResult same =
      Registration(small.problem, corrected(options)).search(start_near_gold(small));
  EXPECT_EQ(same.stop_reason, StopReason::EvaluationBudgetSpent);
  EXPECT_EQ(same.room_from_ct.matrix(), plain.room_from_ct.matrix());
  EXPECT_EQ(same.correction->casts, 0);
  EXPECT_FALSE(same.correction->stood_still);
  EXPECT_TRUE(std::isnan(same.correction->moved_mm));
}

TEST(Correction, OfAPortfolioCorrectsTheChosenEndAndJudgesIt) {
  const test::SmallCase small = spoilt_case();
  RegistrationOptions options = corrected(one_stage("ncc", "gauss-newton"));
  options.chains.push_back(options.chains.front());
  options.judge.stage = StageOptions();
  options.judge.stage.similarity.name = "rg";
  options.judge.enough_value = 2.0;  // never
  Registration registration(small.problem, options);
  const RegistrationResult result = registration.search(start_near_gold(small));
  EXPECT_LT(distance_mm(small, result.room_from_ct, small.gold_room_from_ct), kGaussNewtonErrorMm);
  EXPECT_EQ(result.similarity, registration.similarity_at(result.room_from_ct).similarity);
  // The correction comes after all stages.
  EXPECT_EQ(result.trace.back().pass, 2);
}

TEST(Correction, LeavesAnEndWhoseCorrectedPoseNoFieldHolds) {
  test::SmallCase small = spoilt_case();
  const RigidTransform start = start_near_gold(small);
  for (RegistrationView& view : small.problem->views)
    view.renderer = std::make_shared<const test::NarrowDrr>(view.renderer, start, 1e-3);
  small.problem->nominal_room_from_ct = start;
  const RegistrationOptions options = corrected(one_stage("ncc", "gauss-newton"));
  const RegistrationResult result = Registration(small.problem, options).search(start);
  EXPECT_LT((result.room_from_ct.translation() - start.translation()).norm(), 1e-3);
  EXPECT_GE(result.correction->casts, 1);
  // Not 0 mm, which would read as an end that ray casting confirmed.
  EXPECT_TRUE(std::isnan(result.correction->moved_mm));
  EXPECT_TRUE(std::isnan(result.correction->last_mm));
  EXPECT_FALSE(result.correction->stood_still);
}

TEST(Correction, HasNoDistanceWhenNoEvaluationIsLeft) {
  const test::SmallCase small = spoilt_case();
  RegistrationOptions options = one_stage("ncc", "gauss-newton");
  options.max_evaluations =
      Registration(small.problem, options).search(start_near_gold(small)).evaluations;
  const RegistrationResult spent =
      Registration(small.problem, corrected(options)).search(start_near_gold(small));
  EXPECT_NE(spent.stop_reason, StopReason::EvaluationBudgetSpent);
  EXPECT_EQ(spent.correction->casts, 0);
  EXPECT_TRUE(std::isnan(spent.correction->moved_mm));
  EXPECT_FALSE(spent.correction->stood_still);
}

TEST(Correction, StaysInsideTheMotionRange) {
  test::SmallCase small = spoilt_case();
  RegistrationOptions options = one_stage("ncc", "gauss-newton");
  const RegistrationResult plain =
      Registration(small.problem, options).search(start_near_gold(small));
  // A range whose wall stands a hundredth of a millimetre from the end of look-up.
  for (RegistrationView& view : small.problem->views)
    view.limit = MotionLimit{PoseFrame::about(plain.room_from_ct, small.problem->center_ct_mm),
                             MotionRange{1e-4, 0.01}};
  const RegistrationResult result =
      Registration(small.problem, corrected(options)).search(plain.room_from_ct);
  EXPECT_EQ(result.stop_reason, StopReason::PinnedAtLimit);
  EXPECT_GT(result.correction->moved_mm, 0.0);
  EXPECT_TRUE(small.problem->views.front().limit->range.contains(
      parameters_from_pose(small.problem->views.front().limit->frame, result.room_from_ct)));
}

TEST(Correction, HasTheSameBitsOnAnyNumberOfThreadsAndInAnotherRunner) {
  const test::SmallCase small = spoilt_case();
  const RegistrationOptions options = corrected(one_stage("rg", "gauss-newton"));
  Registration alone(small.problem, options);
  Registration other(small.problem, options);
  Registration threads(small.problem, options, std::make_shared<ThreadPool>(3));
  const RegistrationResult first = alone.search(start_near_gold(small));
  for (Registration* const registration : {&alone, &other, &threads}) {
    const RegistrationResult again = registration->search(start_near_gold(small));
    EXPECT_EQ(again.room_from_ct.matrix(), first.room_from_ct.matrix());
    EXPECT_EQ(again.correction->casts, first.correction->casts);
    EXPECT_EQ(again.correction->last_mm, first.correction->last_mm);
  }
}

TEST(Correction, IsRefusedWithoutRayCastingOrTarget) {
  const RegistrationOptions options = corrected(one_stage("ncc", "gauss-newton"));
  const auto refusal = [&](const test::SmallCase& small) {
    try {
      Registration(small.problem, options);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(refusal(spoilt_case()), "accepted");
  test::SmallCase no_casts = spoilt_case();
  for (RegistrationView& view : no_casts.problem->views) view.ray_casts.clear();
  EXPECT_NE(refusal(no_casts).find("view 'AP': ray_casts = none for level 0"), std::string::npos);
  test::SmallCase no_target = spoilt_case();
  no_target.problem->target_points_ct.clear();
  EXPECT_NE(refusal(no_target).find("target_points_ct = none"), std::string::npos);
}

TEST(RegistrationOptions, KnowsTheLevelsThatItCanEndWith) {
  EXPECT_EQ(preset_options("paper").last_levels(), std::vector<int>{0});
  EXPECT_EQ(preset_options("fast").last_levels(), std::vector<int>{1});
  RegistrationOptions robust = preset_options("robust");
  EXPECT_EQ(robust.last_levels(), std::vector<int>{0});
  robust.finish.stages.clear();
  robust.chains.front().stages.back().level = 2;
  EXPECT_EQ(robust.last_levels(), (std::vector<int>{1, 2}));
}

TEST(CorrectionOptions, ShortenALongStepOfRayCastingWhereACorrectionIsWanted) {
  CorrectionOptions options;
  EXPECT_EQ(options.cast_step_mm(1.0), 1.0);
  options.is_wanted = true;
  EXPECT_EQ(options.cast_step_mm(1.0), options.step_mm);
  EXPECT_EQ(options.cast_step_mm(0.25), 0.25);
}

}  // namespace
}  // namespace af::registration
