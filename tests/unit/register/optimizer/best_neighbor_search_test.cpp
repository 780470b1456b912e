// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/best_neighbor_search.h"

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/joined.h"
#include "unit/register/optimizer/function_target.h"

namespace af::registration {
namespace {

ScaledParameters optimum() {
  ScaledParameters point;
  point << 3.1, -4.7, 0.33, 7.9, -0.06, 1.234;
  return point;
}

OptimizerResult search(OptimizationTarget& target,
                       const OptimizerOptions& options = {5.0, 0.5},
                       int max_evaluations = 100000) {
  OptimizerResult result;
  best_neighbor_search(target, options, {max_evaluations, 0}, result);
  return result;
}

TEST(BestNeighborSearch, FindsAQuadraticsMaximumToTheFinalStep) {
  test::FunctionTarget target(
      [](const ScaledParameters& p) { return -(p - optimum()).squaredNorm(); });
  const OptimizerOptions options{5.0, 0.1};
  const OptimizerResult result = search(target, options);
  EXPECT_EQ(result.stop_reason, StopReason::StepBelowFinal);
  // A separable quadratic has no better neighbour only when every parameter is within half a step.
  for (int i = 0; i < 6; ++i)
    EXPECT_LE(std::abs(result.point[i] - optimum()[i]), options.final_step_mm / 2.0 + 1e-12) << i;
  EXPECT_EQ(result.value, -(result.point - optimum()).squaredNorm());
}

TEST(BestNeighborSearch, CountsEveryEvaluation) {
  test::FunctionTarget target(
      [](const ScaledParameters& p) { return -(p - optimum()).squaredNorm(); });
  const OptimizerResult result = search(target);
  EXPECT_EQ(static_cast<std::size_t>(result.evaluations), target.points.size());
  // One for the start and twelve for each line of the trace.
  EXPECT_EQ(result.evaluations, 1 + 12 * static_cast<int>(result.trace.size()));
  EXPECT_EQ(result.trace.back().evaluations, result.evaluations);
}

TEST(BestNeighborSearch, HalvesTheStepDownToExactlyTheFinalOne) {
  test::FunctionTarget target([](const ScaledParameters& p) { return -p.squaredNorm(); });
  const OptimizerResult result = search(target, {2.0, 0.1});
  const std::vector<double> expected = {2.0, 1.0, 0.5, 0.25, 0.125, 0.1};
  ASSERT_EQ(result.trace.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(result.trace[i].step_mm, expected[i]);
}

TEST(BestNeighborSearch, TakesTheFirstOfEquallyGoodNeighbours) {
  // All twelve neighbours of the start are equally good; their neighbours are worse.
  test::FunctionTarget target([](const ScaledParameters& p) {
    const double distance = p.norm();
    return -(distance - 5.0) * (distance - 5.0);
  });
  const OptimizerResult result = search(target, {5.0, 5.0});
  ScaledParameters expected = ScaledParameters::Zero();
  expected[0] = -5.0;
  EXPECT_EQ(result.point, expected);
}

TEST(BestNeighborSearch, StaysWhenNoNeighbourIsStrictlyBetter) {
  test::FunctionTarget target([](const ScaledParameters&) { return 1.0; });
  const OptimizerResult result = search(target, {1.0, 1.0});
  EXPECT_EQ(result.point, ScaledParameters::Zero());
  EXPECT_EQ(result.stop_reason, StopReason::StepBelowFinal);
  EXPECT_EQ(result.evaluations, 13);
}

TEST(BestNeighborSearch, PassesOverInadmissiblePointsAndReportsALimit) {
  // The optimum along tx lies at 7.9, the limit at 4.
  test::FunctionTarget target([](const ScaledParameters& p) -> std::optional<double> {
    if (p[3] > 4.0) return std::nullopt;
    return -(p - optimum()).squaredNorm();
  });
  const OptimizerResult result = search(target, {5.0, 0.1});
  EXPECT_EQ(result.stop_reason, StopReason::PinnedAtLimit);
  EXPECT_GT(result.inadmissible, 0);
  EXPECT_LE(result.point[3], 4.0);
  EXPECT_GT(result.point[3], 4.0 - 0.1);
}

TEST(BestNeighborSearch, ReportsAnInadmissibleStartAfterOneEvaluation) {
  test::FunctionTarget target([](const ScaledParameters&) { return std::optional<double>(); });
  const OptimizerResult result = search(target);
  EXPECT_EQ(result.stop_reason, StopReason::StartInadmissible);
  EXPECT_EQ(result.evaluations, 1);
  EXPECT_EQ(result.inadmissible, 1);
  EXPECT_TRUE(std::isnan(result.value));
}

TEST(BestNeighborSearch, NeverExceedsItsBudgetAndKeepsTheBestSeen) {
  for (const int budget : {1, 2, 12, 13, 14, 40}) {
    test::FunctionTarget target(
        [](const ScaledParameters& p) { return -(p - optimum()).squaredNorm(); });
    const OptimizerResult result = search(target, {5.0, 0.1}, budget);
    EXPECT_EQ(result.stop_reason, StopReason::EvaluationBudgetSpent) << budget;
    EXPECT_EQ(result.evaluations, budget);
    double best = -std::numeric_limits<double>::infinity();
    for (const ScaledParameters& point : target.points)
      best = std::max(best, -(point - optimum()).squaredNorm());
    EXPECT_EQ(result.value, best) << budget;
  }
}

TEST(BestNeighborSearch, StopsAtANonFiniteValue) {
  test::FunctionTarget target([](const ScaledParameters& p) {
    return p[4] > 0.0 ? std::numeric_limits<double>::quiet_NaN() : -p.squaredNorm();
  });
  const OptimizerResult result = search(target);
  EXPECT_EQ(result.stop_reason, StopReason::NonFiniteSimilarity);
  EXPECT_EQ(result.point, ScaledParameters::Zero());
}

TEST(OptimizerOptions, NamesStepsThatCannotBe) {
  const std::vector<std::string> found = field_problems(OptimizerOptions{0.1, 0.5});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0], "initial_step_mm = 0.1: must be >= final_step_mm = 0.5");
  EXPECT_EQ(field_problems(OptimizerOptions{1.0, 0.0}).size(), 1U);
  EXPECT_EQ(field_problems(OptimizerOptions{std::nan(""), std::nan("")}).size(), 2U);
}

TEST(Optimizer, AnUnknownNameIsRefusedWithTheKnownOnes) {
  try {
    known_optimizer("newton");
    FAIL() << "must throw";
  } catch (const InputError& error) {
    EXPECT_EQ(error.what(), "optimizer = 'newton': must be one of " + joined(optimizer_names()));
  }
}

}  // namespace
}  // namespace af::registration
