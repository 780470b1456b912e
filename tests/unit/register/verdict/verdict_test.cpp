// SPDX-License-Identifier: Apache-2.0
// Verdicts on the ends of registrations, and what is said of X-rays that do not fit.
#include "register/verdict/verdict.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "register/verdict/pose_examiner.h"
#include "register/verdict/registration.h"
#include "register/verdict/view_diagnosis.h"
#include "unit/register/method/narrow_drr.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

/// A record that converged, with a predicted TRE.
RegistrationRecord record_with(double confidence,
                               const std::vector<ViewValue>& values = {{0.9, 0.9}, {0.9, 0.9}}) {
  RegistrationRecord record;
  record.view_values = values;
  record.uncertainty.confidence = confidence;
  record.uncertainty.tre_rms_mm = 0.2;
  return record;
}

Verdict verdict_of(const RegistrationRecord& record) {
  const Judgement judgement = judgement_of(record);
  EXPECT_FALSE(judgement.reason.empty());
  return judgement.verdict;
}

TEST(Judgement, FollowsTheConfidenceAlone) {
  const std::vector<std::pair<double, Verdict>> expected = {{1.0, Verdict::Found},
                                                            {0.99, Verdict::Found},
                                                            {0.9899, Verdict::Doubtful},
                                                            {0.05, Verdict::Doubtful},
                                                            {0.0499, Verdict::NotFound},
                                                            {0.0, Verdict::NotFound},
                                                            {std::nan(""), Verdict::Doubtful}};
  // How much the X-rays show of the pose must not matter: under stress, or in a coarse field, it is
  // little.
  for (const auto& [confidence, verdict] : expected)
    for (const ViewValue value : {ViewValue{0.9, 0.9}, ViewValue{0.15, 0.05}})
      EXPECT_EQ(verdict_of(record_with(confidence, {value, value})), verdict) << confidence;
}

TEST(Judgement, SaysTheProbabilityAndWhatWasWanted) {
  const auto reason = [](double confidence) {
    return judgement_of(record_with(confidence)).reason;
  };
  EXPECT_EQ(reason(0.9968), "right with 99.6 % (TRE below 2.5 mm), at least 99.0 % wanted");
  EXPECT_EQ(reason(1.0), "right with 99.9 % (TRE below 2.5 mm), at least 99.0 % wanted");
  // Percentages are rounded down, since 99.0 % would be found.
  EXPECT_EQ(reason(0.98999), "right with 98.9 % (TRE below 2.5 mm), at least 99.0 % wanted");
  EXPECT_EQ(reason(0.012), "right with 1.2 % (TRE below 2.5 mm), at least 5.0 % wanted");
  EXPECT_EQ(
      judgement_of(record_with(0.9968, {{0.9, 0.9}})).reason,
      "right with 99.6 % (mRPD below 2.5 mm), at least 99.0 % wanted; depth along the beam not "
      "known");
}

TEST(Judgement, AnEndElsewhereThatIsAsAlikeLeavesADoubt) {
  const test::SmallCase small = test::small_case();
  const auto ended = [](double explained, double x_mm) {
    RegistrationRecord record = record_with(0.9968, {{explained, 0.9}, {explained, 0.9}});
    record.result.similarity = 1.0 + explained;  // like a measure that is never 0
    record.result.room_from_ct.translation().x() = x_mm;
    return record;
  };
  RegistrationRecord record = ended(0.8, 0.0);
  RegistrationRecord not_found = ended(0.8, 50.0);
  not_found.uncertainty.confidence = 0.01;
  // An end at the same place and one that is not found are no rivals; an end elsewhere is.
  set_rival(*small.problem, {record, ended(0.79, 3.0), not_found}, record);
  EXPECT_FALSE(record.rival.has_value());
  set_rival(*small.problem, {record, ended(0.6, 60.0), ended(0.68, 30.0)}, record);
  ASSERT_TRUE(record.rival.has_value());
  EXPECT_NEAR(record.rival->apart_mm, 30.0, 1e-9);
  EXPECT_NEAR(record.rival->share, 0.85, 1e-12);
  EXPECT_EQ(verdict_of(record), Verdict::Found);
  set_rival(*small.problem, {record, ended(0.76, 30.0)}, record);
  EXPECT_EQ(verdict_of(record), Verdict::Doubtful);
  EXPECT_THAT(
      judgement_of(record).reason,
      ::testing::HasSubstr(
          "ambiguous: an end 30 mm from here reaches 95 % of what this one explains; but for"));
  // A quarter turn about a small target's middle moves it little.
  RegistrationRecord turned = ended(0.76, 0.0);
  turned.result.room_from_ct.rotate(Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitZ()));
  set_rival(*small.problem, {record, turned}, record);
  EXPECT_TRUE(record.rival.has_value());
}

TEST(Judgement, WithOneViewAnEndAtAnotherDepthIsNoRival) {
  test::SmallCase small = test::small_case();
  small.problem->views.resize(1);  // looks along y
  const auto ended = [](const Eigen::Vector3d& translation) {
    RegistrationRecord record = record_with(0.9968, {{0.8, 0.9}});
    record.result.room_from_ct.translation() = translation;
    return record;
  };
  RegistrationRecord record = ended({0, 0, 0});
  // 25 mm of 650: points 40 mm aside move across the beam by 1.5 mm.
  set_rival(*small.problem, {record, ended({0, 25, 0})}, record);
  EXPECT_FALSE(record.rival.has_value());
  set_rival(*small.problem, {record, ended({25, 0, 0})}, record);
  EXPECT_TRUE(record.rival.has_value());
}

TEST(Judgement, TheBestRecordIsFoundAndMostAlike) {
  std::vector<RegistrationRecord> records;
  for (const auto& [confidence, similarity] :
       {std::pair(0.01, 0.9), {0.5, 0.6}, {0.999, 0.7}, {0.999, 0.7}, {0.999, std::nan("")}}) {
    records.push_back(record_with(confidence));
    records.back().result.similarity = similarity;
    records.back().start_index = static_cast<std::int64_t>(records.size());
  }
  EXPECT_EQ(best_record(records), 2u) << "not found is worse; of equals the first is better";
}

// Without a predicted TRE the confidence is a lower bound.
TEST(Judgement, WithoutAPredictedTreRejectsNothing) {
  RegistrationRecord record = record_with(0.012);
  record.uncertainty.tre_rms_mm = std::nan("");
  EXPECT_EQ(verdict_of(record), Verdict::Doubtful);
  EXPECT_EQ(judgement_of(record).reason,
            "right with at least 1.2 % (TRE below 2.5 mm), at least 99.0 % wanted");
  record.uncertainty.confidence = 0.995;
  EXPECT_EQ(verdict_of(record), Verdict::Found);
  record.uncertainty.confidence = 0.0;  // there is no end
  EXPECT_EQ(verdict_of(record), Verdict::NotFound);
}

TEST(Judgement, ATargetThatDisagreesWithItsSurroundingsIsDoubtful) {
  const auto record_of = [](double confidence, const TargetEvidence& target) {
    RegistrationRecord record = record_with(confidence);
    record.uncertainty.target = target;
    return record;
  };
  EXPECT_EQ(verdict_of(record_of(0.01, {0.7, 3.5})), Verdict::NotFound);
  // The better the X-rays are explained, the less a target may be apart.
  RegistrationRecord record = record_of(0.9968, {});
  for (const auto& [explained, most_mm] : {std::pair(0.95, 0.245), {0.5, 0.65}, {0.2, 0.75}}) {
    for (ViewValue& value : record.view_values) value.coarse = explained;
    record.uncertainty.target = {0.7, most_mm - 0.01};
    EXPECT_EQ(verdict_of(record), Verdict::Found) << explained;
    record.uncertainty.target = {0.7, most_mm + 0.01};
    EXPECT_EQ(verdict_of(record), Verdict::Doubtful) << explained;
  }
  EXPECT_EQ(verdict_of(record_of(0.9968, {0.04, 0.0})), Verdict::Doubtful);
  EXPECT_EQ(verdict_of(record_of(0.9968, {})), Verdict::Found) << "the target was not asked";
  EXPECT_EQ(
      judgement_of(record_of(0.9968, {0.7, 3.42})).reason,
      "the target disagrees with its surroundings: by itself it fits 3.5 mm from here; it may "
      "have moved against the rest; but for that right with 99.6 % (TRE below 2.5 mm), at "
      "least 99.0 % wanted");
}

TEST(Judgement, SaysWhereTheTargetHasNoAnswer) {
  const std::string missing = "; not checked: whether the target has moved against the rest";
  for (const auto& [confidence, verdict] :
       {std::pair(0.9968, Verdict::Found), {0.985, Verdict::Doubtful}}) {
    RegistrationRecord record = record_with(confidence);
    const std::string reason = judgement_of(record).reason;
    record.uncertainty.target.has_no_answer = true;
    EXPECT_EQ(verdict_of(record), verdict);
    EXPECT_EQ(judgement_of(record).reason, reason + missing);
  }
}

TEST(Judgement, AnAgreeingTargetDoublesTheOdds) {
  EXPECT_NEAR(confidence_if_target_agrees(0.5), 2.0 / 3.0, 1e-12);
  EXPECT_NEAR(confidence_if_target_agrees(0.99), 198.0 / 199.0, 1e-12);
  EXPECT_EQ(confidence_if_target_agrees(0.0), 0.0);
  EXPECT_EQ(confidence_if_target_agrees(1.0), 1.0);
  const std::vector<ViewValue> values(2, {0.9, 0.9});
  EXPECT_TRUE(agrees_with_surroundings({0.7, 0.2}, values));
  EXPECT_FALSE(agrees_with_surroundings({0.7, 0.4}, values));
  EXPECT_FALSE(agrees_with_surroundings({0.04, 0.0}, values));
  EXPECT_FALSE(agrees_with_surroundings({}, values)) << "the target was not asked";
}

TEST(Judgement, OfOneViewSaysWhatIsNotKnown) {
  const auto record_of = [](double confidence, double depth_95_mm, std::size_t views) {
    RegistrationRecord record = record_with(confidence, std::vector<ViewValue>(views, {0.9, 0.9}));
    record.uncertainty.depth_95_mm = depth_95_mm;
    return record;
  };
  const auto reason = [&](double depth_95_mm) {
    return judgement_of(record_of(0.9968, depth_95_mm, 1)).reason;
  };
  EXPECT_THAT(reason(24.0), testing::EndsWith("wanted; depth along the beam within 24 mm"));
  EXPECT_THAT(reason(23.01), testing::EndsWith("depth along the beam within 24 mm"));
  EXPECT_THAT(reason(9.91), testing::EndsWith("depth along the beam within 10 mm"));
  EXPECT_THAT(reason(0.01), testing::EndsWith("depth along the beam within 0.1 mm"));
  EXPECT_THAT(reason(std::nan("")), testing::EndsWith("depth along the beam not known"));
  EXPECT_EQ(verdict_of(record_of(0.9968, 24.0, 1)), Verdict::Found);
  for (const RegistrationRecord& record : {record_of(0.9968, 24.0, 2), record_of(0.01, 24.0, 1)})
    EXPECT_THAT(judgement_of(record).reason, testing::Not(testing::HasSubstr("along the beam")));
}

TEST(Judgement, WhatWasNotSearchedIsNotFoundWhateverItsValue) {
  RegistrationRecord record = record_with(0.995);
  for (const StopReason reason : {StopReason::StartInadmissible,
                                  StopReason::CtOutsideRoi,
                                  StopReason::NonFiniteSimilarity,
                                  StopReason::NoBetterThanNoDrr}) {
    record.result.stop_reason = reason;
    EXPECT_EQ(verdict_of(record), Verdict::NotFound) << to_string(reason);
    EXPECT_EQ(judgement_of(record).reason.find("right with"), std::string::npos);
  }
  for (const StopReason reason : {StopReason::PinnedAtLimit, StopReason::EvaluationBudgetSpent}) {
    record.result.stop_reason = reason;
    EXPECT_EQ(verdict_of(record), Verdict::Doubtful) << to_string(reason);
  }
  record = record_with(0.01);
  record.result.stop_reason = StopReason::PinnedAtLimit;
  EXPECT_EQ(verdict_of(record), Verdict::NotFound);
}

TEST(Judgement, SaysWhereTheRangeEndsAndWhereTheStartWasClipped) {
  const std::string probability = "right with 99.5 % (TRE below 2.5 mm), at least 99.0 % wanted";
  RegistrationRecord record = record_with(0.9951);
  record.result.stop_reason = StopReason::PinnedAtLimit;
  record.result.pinned_along = "rx, rz, tx";
  const std::string ends =
      "the field's range ends here along rx, rz, tx: the optimum may lie outside";
  EXPECT_EQ(judgement_of(record).reason, ends + "; but for that " + probability);
  // The messages of a diagnosis do not replace that reason.
  record.diagnosis.messages = {"view 'B' does not agree"};
  EXPECT_EQ(judgement_of(record).reason,
            "view 'B' does not agree; " + ends + "; but for that " + probability);
  // Where the probability causes the doubt, it comes first.
  record.uncertainty.confidence = 0.5;
  EXPECT_EQ(judgement_of(record).reason.find("right with 50.0 % "), 0U);
  record.uncertainty.confidence = 0.9951;
  EXPECT_EQ(verdict_of(record), Verdict::Doubtful);
  record.result = RegistrationResult();
  EXPECT_EQ(verdict_of(record), Verdict::Doubtful) << "the message of a diagnosis is enough";
  record = record_with(0.9951);
  record.result.clipped_along = "ry";
  EXPECT_EQ(verdict_of(record), Verdict::Found);
  EXPECT_EQ(
      judgement_of(record).reason,
      probability + "; the start lay outside the field's range along ry and was clipped into it");
}

TEST(Judgement, AViewThatCannotBeJudgedLeavesADoubt) {
  const double nan = std::nan("");
  const auto verdict_with = [](const std::vector<ViewValue>& values, double confidence) {
    return verdict_of(record_with(confidence, values));
  };
  EXPECT_EQ(verdict_with({{nan, nan}, {0.6, 0.5}}, 0.995), Verdict::Doubtful);
  EXPECT_EQ(verdict_with({{0.6, nan}, {0.6, 0.5}}, 0.995), Verdict::Doubtful);
  EXPECT_EQ(verdict_with({{nan, nan}, {0.1, 0.1}}, 0.01), Verdict::NotFound);
  EXPECT_EQ(verdict_with({{nan, nan}}, nan), Verdict::Doubtful);
  EXPECT_EQ(verdict_with({}, nan), Verdict::Doubtful);
  EXPECT_NE(judgement_of(record_with(0.995, {{0.6, 0.5}, {nan, nan}}))
                .reason.find("X-ray 2 of 2 cannot be judged"),
            std::string::npos);
}

TEST(Disagreement, IsOneViewFarBelowAnotherThatIsGood) {
  const std::vector<ViewValue> one_bad = {{0.7, 0.6}, {0.1, 0.0}, {0.6, 0.5}};
  EXPECT_FALSE(disagrees(0, one_bad));
  EXPECT_TRUE(disagrees(1, one_bad));
  const std::vector<ViewValue> bad_in_detail = {{0.9, 0.8}, {0.4, 0.1}};
  EXPECT_TRUE(disagrees(1, bad_in_detail));
  const std::vector<ViewValue> both_bad = {{0.25, 0.1}, {0.1, 0.0}};
  EXPECT_FALSE(disagrees(1, both_bad));
  const std::vector<ViewValue> alike = {{0.45, 0.2}, {0.29, 0.0}};
  EXPECT_FALSE(disagrees(1, alike));
  // Within silhouettes less detail is enough.
  EXPECT_TRUE(disagrees(1, std::vector<ViewValue>{{0.9, 0.6}, {0.9, 0.26}}));
  EXPECT_FALSE(disagrees(1, std::vector<ViewValue>{{0.9, 0.6, true}, {0.9, 0.26, true}}));
  EXPECT_TRUE(disagrees(1, std::vector<ViewValue>{{0.9, 0.6, true}, {0.9, 0.22, true}}));
}

/// A small case with pyramids (of the same renderer), which the diagnosis needs.
test::SmallCase case_with_levels() {
  test::SmallCase small = test::small_case(test::bones_in_a_corner());
  for (RegistrationView& view : small.problem->views)
    view.coarse_levels = {{view.renderer, 0.0}, {view.renderer, 0.0}};
  return small;
}

RigidTransform beside_gold(const test::SmallCase& small, double mm) {
  const PoseFrame frame = PoseFrame::about(small.gold_room_from_ct, small.problem->center_ct_mm);
  return pose_from_parameters(frame, PoseParameters::from_deg_and_mm({0, 0, 0, mm, mm, mm}));
}

TEST(PoseExaminer, TellsARightPoseFromAWrongOneInEveryView) {
  const test::SmallCase small = case_with_levels();
  PoseExaminer examiner(small.problem, 0.0);
  const auto right = examiner.view_values(small.gold_room_from_ct);
  const auto wrong = examiner.view_values(beside_gold(small, 8.0));
  ASSERT_EQ(right.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_GT(right[i].coarse, kWellExplained.coarse);
    EXPECT_GT(right[i].fine, kWellExplained.fine);
    EXPECT_LT(wrong[i].coarse, 0.5 * right[i].coarse);
  }
}

TEST(PoseExaminer, BackgroundIsFarBelowARightPose) {
  const test::SmallCase small = case_with_levels();
  PoseExaminer examiner(small.problem, 0.0);
  EXPECT_TRUE(std::isnan(examiner.view_values(small.gold_room_from_ct)[0].background));
  for (const ViewValue& value : examiner.view_values(small.gold_room_from_ct, true))
    EXPECT_LT(value.background, 0.3 * value.fine);
}

TEST(PoseExaminer, MeanBackgroundIsOfTheViewsThatAreJudged) {
  const double none = std::nan("");
  EXPECT_DOUBLE_EQ(mean_background(std::vector<ViewValue>{
                       {0.5, 0.4, false, 0.1}, {0.5, 0.4, false, 0.3}, {none, none}}),
                   0.2);
  EXPECT_TRUE(std::isnan(
      mean_background(std::vector<ViewValue>{{0.5, 0.4, false, 0.1}, {0.5, 0.4, false, none}})));
  EXPECT_TRUE(std::isnan(mean_background({})));
}

TEST(PoseExaminer, AViewThatShowsNothingLeavesNoExcess) {
  const double none = std::nan("");
  const auto excess = [](std::vector<ViewValue> values) { return explained_excess(values); };
  const ViewValue more = {0.5, 0.4, false, 0.1};
  const ViewValue less = {0.5, 0.3, false, 0.2};
  EXPECT_DOUBLE_EQ(excess({more}), 0.3);
  EXPECT_DOUBLE_EQ(excess({more, less}), 2.0 / (1.0 / 0.3 + 1.0 / 0.1));
  EXPECT_DOUBLE_EQ(excess({less, more}), excess({more, less}));
  EXPECT_EQ(excess({more, {0.5, 0.2, false, 0.2}}), 0.0);  // as much as beside it
  EXPECT_EQ(excess({more, {0.5, 0.1, false, 0.2}}), 0.0);
  EXPECT_DOUBLE_EQ(excess({more, {none, none}}), 0.3);  // cannot be judged: does not count
  EXPECT_TRUE(std::isnan(excess({more, {0.5, 0.4, false, none}})));
  EXPECT_TRUE(std::isnan(excess({})));
}

TEST(PoseExaminer, BackgroundIsTakenNearerWhereAFieldEnds) {
  const auto background_within = [](double reach_mm) {
    test::SmallCase small = case_with_levels();
    for (RegistrationView& view : small.problem->views)
      view.renderer =
          std::make_shared<const test::NarrowDrr>(view.renderer, small.gold_room_from_ct, reach_mm);
    return PoseExaminer(small.problem, 0.0)
        .view_values(small.gold_room_from_ct, true)[0]
        .background;
  };
  const double far = background_within(1.01 * kBackgroundDistanceMm);
  const double near = background_within(0.26 * kBackgroundDistanceMm);
  EXPECT_LT(far, near);
  EXPECT_TRUE(std::isnan(background_within(0.24 * kBackgroundDistanceMm)));
}

TEST(PoseExaminer, DoesNotJudgeAnXrayWithoutGradients) {
  const test::SmallCase small = case_with_levels();
  for (float& value : small.problem->views[1].xray.pixels) value = 1.0f;
  const auto values = PoseExaminer(small.problem, 0.0).view_values(small.gold_room_from_ct);
  EXPECT_TRUE(std::isfinite(values[0].coarse));
  EXPECT_TRUE(std::isnan(values[1].coarse));
}

std::vector<ViewValue> values_at_gold(const test::SmallCase& small) {
  return PoseExaminer(small.problem, 0.0).view_values(small.gold_room_from_ct);
}

/// A case that `harm` has changed, with its nominal pose beside the gold one.
test::SmallCase harmed_case(const std::function<void(RegistrationProblem&)>& harm) {
  test::SmallCase small = case_with_levels();
  small.problem->nominal_room_from_ct = beside_gold(small, 1.0);
  harm(*small.problem);
  return small;
}

/// All that is said about such a case at the gold pose.
std::string sayings_of(const std::function<void(RegistrationProblem&)>& harm) {
  const test::SmallCase small = harmed_case(harm);
  std::string text;
  for (const std::string& saying :
       ViewDiagnoser(small.problem).diagnosis(values_at_gold(small)).messages)
    text += saying + '\n';
  return text;
}

void turn(Image2d& image) {
  std::reverse(image.pixels.begin(), image.pixels.end());
}

void flip_columns(Image2d& image) {
  for (int row = 0; row < image.height; ++row) {
    const auto begin = image.pixels.begin() + static_cast<std::ptrdiff_t>(row) * image.width;
    std::reverse(begin, begin + image.width);
  }
}

TEST(ViewDiagnoser, NamesTheViewAndWhatWouldMendIt) {
  struct Defect {
    const char* expected;
    std::function<void(Image2d&)> make;
  };
  for (const Defect& defect : {Defect{"inverted",
                                      [](Image2d& image) {
                                        for (float& value : image.pixels) value = 3.0f - value;
                                      }},
                               Defect{"mirrored left-right", flip_columns},
                               Defect{"mirrored up-down",
                                      [](Image2d& image) {
                                        flip_columns(image);
                                        turn(image);
                                      }},
                               Defect{"turned by 180 degrees", turn}})
    for (const std::size_t view : {0U, 1U}) {
      const std::string name = view == 0 ? "'AP'" : "'LAT'";
      const std::string text =
          sayings_of([&](RegistrationProblem& p) { defect.make(p.views[view].xray); });
      EXPECT_NE(text.find("view " + name + " does not agree"), std::string::npos) << text;
      EXPECT_NE(text.find("the X-ray of view " + name + " " + defect.expected), std::string::npos)
          << defect.expected << '\n'
          << text;
    }
}

TEST(ViewDiagnoser, NamesNoRemedyForNoise) {
  const std::string text = sayings_of([](RegistrationProblem& problem) {
    HashRandom random(3, 0);
    for (float& value : problem.views[1].xray.pixels)
      value = static_cast<float>(random.uniform(0.0, 3.0));
  });
  EXPECT_NE(text.find("view 'LAT' does not agree"), std::string::npos) << text;
  EXPECT_EQ(text.find("would explain more"), std::string::npos) << text;
}

TEST(ViewDiagnoser, NamesExchangedXraysAndTheSameXrayTwice) {
  const std::string exchanged = sayings_of([](RegistrationProblem& problem) {
    std::swap(problem.views[0].xray, problem.views[1].xray);
  });
  EXPECT_NE(exchanged.find("the X-rays of views 'AP' and 'LAT' exchanged"), std::string::npos)
      << exchanged;
  const std::string same = sayings_of(
      [](RegistrationProblem& problem) { problem.views[1].xray = problem.views[0].xray; });
  EXPECT_NE(same.find("views 'AP' and 'LAT' have the same X-ray"), std::string::npos) << same;
}

TEST(ViewDiagnoser, SaysNothingOfSoundXrays) {
  EXPECT_EQ(sayings_of([](RegistrationProblem&) {}), "");
}

/// Counts its DRRs.
class CountedDrr final : public DrrRenderer {
 public:
  explicit CountedDrr(std::shared_ptr<const DrrRenderer> renderer)
      : renderer_(std::move(renderer)) {}

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients) const override {
    ++drrs;
    return renderer_->render(room_from_ct, view, workspace, total_attenuation, gradients);
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return renderer_->make_workspace();
  }
  [[nodiscard]] const char* name() const override { return renderer_->name(); }
  mutable std::atomic<int> drrs = 0;

 private:
  std::shared_ptr<const DrrRenderer> renderer_;
};

TEST(ViewDiagnoser, TriesChangesOncePerCase) {
  const test::SmallCase small =
      harmed_case([](RegistrationProblem& problem) { turn(problem.views[1].xray); });
  const auto counted = std::make_shared<const CountedDrr>(small.problem->views[1].renderer);
  small.problem->views[1].renderer = counted;
  const std::vector<ViewValue> sound = {{0.9, 0.8}, {0.9, 0.8}};
  const std::vector<ViewValue> worse = {{0.2, 0.1}, {0.1, 0.1}};
  const std::vector<ViewValue> at_gold = values_at_gold(small);
  ViewDiagnoser diagnoser(small.problem);
  const int before = counted->drrs;
  EXPECT_TRUE(diagnoser.diagnosis(sound).messages.empty());
  EXPECT_EQ(counted->drrs, before);
  const std::vector<std::string> said_of_worse = diagnoser.diagnosis(worse).messages;
  const int after = counted->drrs;
  EXPECT_GT(after, before);
  ASSERT_EQ(said_of_worse.size(), 1U);
  EXPECT_NE(said_of_worse[0].find("'LAT' turned by 180 degrees"), std::string::npos);
  // The diagnosis of an end does not depend on the ends examined before it.
  const std::vector<std::string> said_of_gold = diagnoser.diagnosis(at_gold).messages;
  EXPECT_EQ(counted->drrs, after);
  EXPECT_EQ(said_of_gold, ViewDiagnoser(small.problem).diagnosis(at_gold).messages);
  EXPECT_NE(said_of_gold, said_of_worse);
}

}  // namespace
}  // namespace af::registration
