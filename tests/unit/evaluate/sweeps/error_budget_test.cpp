// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/error_budget.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"

namespace af::evaluation {
namespace {

using Ends = std::vector<std::optional<PoseParameters>>;

// Sums and means of a few values of up to 10 mm.
constexpr double kBudgetRoundingMm = 1e-13;

const std::vector<Eigen::Vector3d> kTarget = {{10, 0, 0}, {-10, 0, 0}, {0, 10, 0}, {0, -10, 0}};

PoseParameters shift(double tx_mm, double ty_mm = 0.0) {
  return PoseParameters::from_deg_and_mm({0, 0, 0, tx_mm, ty_mm, 0});
}

TEST(ErrorBudget, OfHandBuiltEndsIsTheKnownOne) {
  // Mean ends (1, 0), (1, 2), (4, 2) mm; the last start fails once and counts for nobody.
  const std::vector<BudgetRun> runs = {
      {"ideal", Ends{shift(0.5), shift(1.5), shift(9)}},
      {"blurred", Ends{shift(0.5, 2), shift(1.5, 2), std::nullopt}},
      {"field", Ends{shift(5, 2), shift(3, 2), shift(9)}}};
  const ErrorBudget budget = error_budget(runs, PoseFrame{}, kTarget);
  EXPECT_EQ(budget.common_starts, 2u);
  ASSERT_EQ(budget.steps.size(), 3u);
  const BudgetStep& ideal = budget.steps[0];
  EXPECT_EQ(ideal.successes, 3u);
  EXPECT_TRUE(std::isnan(ideal.shift_mm));
  EXPECT_NEAR(ideal.bias_mm, 1.0, kBudgetRoundingMm);
  EXPECT_NEAR(ideal.scatter_mm, 0.5, kBudgetRoundingMm);
  EXPECT_NEAR(ideal.tre_mm, 1.0, kBudgetRoundingMm);
  const BudgetStep& blurred = budget.steps[1];
  EXPECT_EQ(blurred.successes, 2u);
  EXPECT_NEAR(blurred.shift_mm, 2.0, kBudgetRoundingMm);
  // Both starts moved alike.
  EXPECT_NEAR(blurred.shift_standard_error_mm, 0.0, kBudgetRoundingMm);
  EXPECT_NEAR(blurred.bias_mm, std::sqrt(5.0), kBudgetRoundingMm);
  const BudgetStep& field = budget.steps[2];
  EXPECT_NEAR(field.shift_mm, 3.0, kBudgetRoundingMm);
  // Changes of 4.5 and 1.5 mm: SD 3 / sqrt(2), standard error 1.5.
  EXPECT_NEAR(field.shift_standard_error_mm, 1.5, kBudgetRoundingMm);
}

TEST(ErrorBudget, ShiftsAddUpToTheLastBias) {
  const std::vector<BudgetRun> runs = {
      {"a", Ends{PoseParameters::from_deg_and_mm({0.1, 0.2, -0.3, 1, 2, 3}), shift(1)}},
      {"b", Ends{PoseParameters::from_deg_and_mm({0.3, -0.2, 0.1, 0, 1, -3}), shift(2)}},
      {"c", Ends{PoseParameters::from_deg_and_mm({-0.2, 0.4, 0.2, 2, 0, 1}), shift(-1, 3)}}};
  const ErrorBudget budget = error_budget(runs, PoseFrame{}, kTarget);
  std::array<double, 6> sum = budget.steps[0].mean_end.deg_and_mm();
  for (std::size_t i = 1; i < budget.steps.size(); ++i)
    for (std::size_t p = 0; p < 6; ++p)
      sum[p] +=
          budget.steps[i].mean_end.deg_and_mm()[p] - budget.steps[i - 1].mean_end.deg_and_mm()[p];
  for (std::size_t p = 0; p < 6; ++p)
    EXPECT_NEAR(sum[p], budget.steps.back().mean_end.deg_and_mm()[p], kBudgetRoundingMm) << p;
  // A step is never longer than the way there and back.
  EXPECT_LE(budget.steps[2].bias_mm, budget.steps[1].bias_mm + budget.steps[2].shift_mm + 1e-9);
}

TEST(ErrorBudget, RefusesWhatItCannotCompare) {
  const BudgetRun two = {"two", Ends{shift(1), shift(2)}};
  const BudgetRun one_success = {"one", Ends{shift(1), std::nullopt}};
  const BudgetRun three = {"three", Ends{shift(1), shift(2), shift(3)}};
  const auto budget = [](const std::vector<BudgetRun>& runs) {
    return error_budget(runs, PoseFrame{}, kTarget);
  };
  EXPECT_THROW(budget({two}), InputError);
  EXPECT_THROW(budget({two, three}), InputError);
  EXPECT_THROW(budget({two, one_success}), InputError);
  EXPECT_THROW(error_budget(std::vector{two, two}, PoseFrame{}, {}), InputError);
}

}  // namespace
}  // namespace af::evaluation
