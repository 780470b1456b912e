// SPDX-License-Identifier: Apache-2.0
// What all optimisers must do, and what each is for.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include <gtest/gtest.h>

#include "base/error.h"
#include "register/optimizer/curvature_bounds.h"
#include "register/optimizer/newton_search.h"
#include "register/optimizer/optimizer.h"
#include "unit/register/optimizer/function_target.h"

namespace af::registration {
namespace {

constexpr double kFinalStepMm = 0.01;

ScaledParameters quadratic_optimum() {
  ScaledParameters point;
  point << 3.1, -4.7, 0.33, 2.9, -0.06, 1.234;
  return point;
}

/// Curvatures from 1 to `condition`, the axes not those of the parameters.
ScaledMatrix curvature(double condition) {
  ScaledMatrix matrix = ScaledMatrix::Zero();
  for (int k = 0; k < 6; ++k) matrix(k, k) = std::pow(condition, k / 5.0);
  ScaledParameters mirror;
  mirror << 1, 2, -1, 0.5, 1, -0.3;
  mirror.normalize();
  const ScaledMatrix reflect = ScaledMatrix::Identity() - 2.0 * mirror * mirror.transpose();
  return reflect * matrix * reflect;
}

/// -(p - optimum)' C (p - optimum) / 2, inadmissible where |p| > `limit`.
test::FunctionTarget quadratic(double condition, double limit = 1e300) {
  const ScaledMatrix matrix = curvature(condition);
  const auto value = [=](const ScaledParameters& p) -> std::optional<double> {
    if (p.norm() > limit) return std::nullopt;
    return -0.5 * (p - quadratic_optimum()).dot(matrix * (p - quadratic_optimum()));
  };
  const auto equations = [=](const ScaledParameters& p) {
    return TargetValue{0.0, matrix * (quadratic_optimum() - p), matrix};
  };
  return test::FunctionTarget(value, equations);
}

/// quadratic() within known limits: no parameter may be above `wall`.
test::FunctionTarget walled_quadratic(const ScaledParameters& wall) {
  const auto free = std::make_shared<test::FunctionTarget>(quadratic(4.0));
  const auto nearest = [=](const ScaledParameters& p) -> ScaledParameters {
    return p.cwiseMin(wall);
  };
  const auto value = [=](const ScaledParameters& p) {
    return nearest(p) == p ? free->evaluate(p) : std::nullopt;
  };
  const auto equations = [=](const ScaledParameters& p) {
    return *free->evaluate_with_normal_equations(p);
  };
  return test::FunctionTarget(value, equations, nearest);
}

OptimizerResult search(const std::string& name,
                       test::FunctionTarget& target,
                       int max_evaluations = 20000,
                       std::uint64_t key = 1) {
  OptimizerResult result;
  known_optimizer(name).maximize(target, {2.0, kFinalStepMm, 16}, {max_evaluations, key}, result);
  return result;
}

class EveryOptimizer : public testing::TestWithParam<std::string> {};

TEST_P(EveryOptimizer, FindsAQuadraticsMaximum) {
  test::FunctionTarget target = quadratic(4.0);
  const OptimizerResult result = search(GetParam(), target);
  EXPECT_EQ(result.stop_reason, StopReason::StepBelowFinal);
  // Steps of the final length come to rest within a few such steps of the optimum in each of six
  // coupled parameters.
  EXPECT_LT((result.point - quadratic_optimum()).norm(), 10.0 * kFinalStepMm);
  EXPECT_EQ(result.value, *target.evaluate(result.point));
  EXPECT_FALSE(result.trace.empty());
}

TEST_P(EveryOptimizer, CountsEveryEvaluationAndKeepsToTheBudget) {
  test::FunctionTarget target = quadratic(4.0);
  const OptimizerResult whole = search(GetParam(), target);
  EXPECT_EQ(static_cast<std::size_t>(whole.evaluations), target.points.size());
  const int budget = whole.evaluations - 2;
  test::FunctionTarget again = quadratic(4.0);
  const OptimizerResult cut = search(GetParam(), again, budget);
  EXPECT_EQ(cut.stop_reason, StopReason::EvaluationBudgetSpent);
  EXPECT_EQ(cut.evaluations, budget);
  EXPECT_EQ(again.points.size(), static_cast<std::size_t>(budget));
  EXPECT_GE(cut.value, -0.5 * quadratic_optimum().dot(curvature(4.0) * quadratic_optimum()));
}

TEST_P(EveryOptimizer, SaysThatTheStartIsInadmissible) {
  test::FunctionTarget target = quadratic(4.0, -1.0);
  const OptimizerResult result = search(GetParam(), target);
  EXPECT_EQ(result.stop_reason, StopReason::StartInadmissible);
  EXPECT_EQ(result.evaluations, 1);
  EXPECT_EQ(result.inadmissible, 1);
  EXPECT_TRUE(std::isnan(result.value));
}

TEST_P(EveryOptimizer, NeverEndsAtAnInadmissiblePoint) {
  // The optimum has length 6.6, so it lies outside.
  constexpr double kLimit = 4.0;
  test::FunctionTarget target = quadratic(4.0, kLimit);
  const OptimizerResult result = search(GetParam(), target);
  EXPECT_LE(result.point.norm(), kLimit);
  EXPECT_GT(result.inadmissible, 0);
  EXPECT_GT(result.value, *quadratic(4.0).evaluate(ScaledParameters::Zero()));
}

TEST_P(EveryOptimizer, SaysThatItIsPinnedAtAWall) {
  // The optimum lies beyond the wall along the first and the fourth parameter.
  constexpr double kWall = 2.0;
  ScaledParameters wall = ScaledParameters::Constant(1e300);
  wall[0] = wall[3] = kWall;
  test::FunctionTarget target = walled_quadratic(wall);
  const OptimizerResult result = search(GetParam(), target);
  EXPECT_EQ(result.stop_reason, StopReason::PinnedAtLimit);
  EXPECT_EQ(result.point.cwiseMin(wall), result.point);
  // Models end early at a cliff, so this asks no more than FindsAQuadraticsMaximum.
  EXPECT_GT(std::max(result.point[0], result.point[3]), kWall - 10.0 * kFinalStepMm);
}

TEST_P(EveryOptimizer, IsNotPinnedNearAWallThatItDoesNotWantToCross) {
  const ScaledParameters wall = quadratic_optimum().cwiseMax(0.0).array() + 40.0 * kFinalStepMm;
  test::FunctionTarget target = walled_quadratic(wall);
  EXPECT_EQ(search(GetParam(), target).stop_reason, StopReason::StepBelowFinal);
}

TEST_P(EveryOptimizer, StopsAtAValueThatIsNotFinite) {
  const auto value = [](const ScaledParameters& p) -> std::optional<double> {
    return p.norm() > 0.5 ? std::numeric_limits<double>::quiet_NaN() : p[0];
  };
  const auto equations = [](const ScaledParameters&) {
    return TargetValue{0.0, ScaledParameters::Unit(0), ScaledMatrix::Identity()};
  };
  test::FunctionTarget target(value, equations);
  const OptimizerResult result = search(GetParam(), target);
  EXPECT_EQ(result.stop_reason, StopReason::NonFiniteSimilarity);
  EXPECT_TRUE(std::isfinite(result.value));
}

TEST_P(EveryOptimizer, RepeatsItself) {
  test::FunctionTarget first = quadratic(4.0);
  test::FunctionTarget second = quadratic(4.0);
  EXPECT_EQ(search(GetParam(), first).point, search(GetParam(), second).point);
}

INSTANTIATE_TEST_SUITE_P(All,
                         EveryOptimizer,
                         testing::ValuesIn(optimizer_names()),
                         [](const auto& chosen) {
                           std::string name = chosen.param;
                           for (char& letter : name)
                             if (letter == '-') letter = '_';
                           return name;
                         });

TEST(GaussNewton, EndsAQuadraticInAFewSteps) {
  test::FunctionTarget target = quadratic(1000.0);
  const OptimizerResult result = search("gauss-newton", target);
  // Four steps of 2 mm over 6.6 mm, and three that converge.
  EXPECT_LE(result.evaluations, 10);
  EXPECT_LT((result.point - quadratic_optimum()).norm(), kFinalStepMm);
}

/// Where the value does not rise as the derivatives promise, every next try is at most half as far,
/// however small the damping was.
TEST(GaussNewton, HalvesRejectedStepsAtLeast) {
  test::FunctionTarget target(
      [](const ScaledParameters& p) -> std::optional<double> { return -p.norm(); },
      [](const ScaledParameters&) {
        return TargetValue{0.0, ScaledParameters::Constant(0.5), curvature(4.0)};
      });
  const OptimizerResult result = search("gauss-newton", target);
  EXPECT_EQ(result.point, ScaledParameters::Zero());
  ASSERT_GT(target.points.size(), 3u);
  for (std::size_t i = 2; i < target.points.size(); ++i)
    EXPECT_LE(target.points[i].norm(), 0.5 * target.points[i - 1].norm()) << i;
}

TEST(QuasiNewton, LearnsMissingCurvature) {
  // Normal equations that overstate the curvature twofold: every plain step goes half of the way,
  // so that 6.6 mm take seven of them after the three that are limited to 2 mm.
  const ScaledMatrix matrix = curvature(4.0);
  const auto overstated = [&] {
    return test::FunctionTarget(
        [=](const ScaledParameters& p) -> std::optional<double> {
          return -0.5 * (p - quadratic_optimum()).dot(matrix * (p - quadratic_optimum()));
        },
        [=](const ScaledParameters& p) {
          return TargetValue{0.0, matrix * (quadratic_optimum() - p), 2.0 * matrix};
        });
  };
  test::FunctionTarget plain = overstated();
  const OptimizerResult by_gauss_newton = search("gauss-newton", plain);
  test::FunctionTarget learned = overstated();
  const OptimizerResult by_quasi_newton = search("quasi-newton", learned);
  EXPECT_GE(by_gauss_newton.evaluations, 10);
  EXPECT_LE(by_quasi_newton.evaluations, by_gauss_newton.evaluations - 3);
  EXPECT_LT((by_quasi_newton.point - quadratic_optimum()).norm(), 0.1 * kFinalStepMm);
}

TEST(QuasiNewton, ForgetsWhatMadeAStepTooLong) {
  // The curvature vanishes and comes back tenfold, so what the first steps teach misleads.
  const auto value = [](double x) {
    return x < 2.0 ? 0.05 * x : 0.1 - 5.0 * (x - 2.0) * (x - 2.0);
  };
  const auto slope = [](double x) { return x < 2.0 ? 0.05 : -10.0 * (x - 2.0); };
  ScaledMatrix matrix = ScaledMatrix::Identity();
  matrix(0, 0) = 0.1;
  test::FunctionTarget target(
      [=](const ScaledParameters& p) -> std::optional<double> {
        return value(p[0]) - 0.5 * p.tail<5>().squaredNorm();
      },
      [=](const ScaledParameters& p) {
        TargetValue at;
        at.gradient << slope(p[0]), -p.tail<5>();
        at.matrix = matrix;
        return at;
      });
  const OptimizerResult result = search("quasi-newton", target);
  EXPECT_EQ(result.stop_reason, StopReason::StepBelowFinal);
  EXPECT_NEAR(result.point[0], 2.0, 0.1);
}

TEST(CurvatureBounds, KeepWhatIsWithin) {
  // A shear makes the directions oblique.
  ScaledMatrix shear = ScaledMatrix::Identity();
  shear(0, 1) = 0.7;
  shear(4, 2) = -0.4;
  const auto sheared = [&](const ScaledParameters& sizes) -> ScaledMatrix {
    return shear.transpose() * sizes.asDiagonal() * shear;
  };
  ScaledParameters scale;
  scale << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0;
  ScaledParameters shares;
  shares << -1.0, 0.01, 0.1, 0.5, 1.0, 2.0;
  ScaledParameters kept;
  kept << 0.1, 0.1, 0.1, 0.5, 1.0, 1.0;
  const ScaledMatrix found =
      kept_between(sheared(scale.cwiseProduct(shares)), sheared(scale), 0.1, 1.0);
  EXPECT_LT((found - sheared(scale.cwiseProduct(kept))).norm(), 1e-12 * found.norm());
  const ScaledMatrix upwards = -ScaledMatrix::Identity();
  EXPECT_EQ(kept_between(found, upwards, 0.1, 1.0), upwards);
  // This matrix has rank five, without a zero on its diagonal.
  ScaledMatrix flat = ScaledMatrix::Identity();
  flat(0, 1) = flat(1, 0) = 1.0;
  EXPECT_EQ(kept_between(found, flat, 0.1, 1.0), flat);
}

TEST(GradientAscent, FindsAnIllConditionedMaximum) {
  test::FunctionTarget target = quadratic(1000.0);
  const OptimizerResult result = search("gradient", target);
  EXPECT_LT((result.point - quadratic_optimum()).norm(), 10.0 * kFinalStepMm);
  EXPECT_LT(result.evaluations, 200);
}

TEST(CmaEs, FindsTheHighestOfManyPeaks) {
  // Rastrigin's function: peaks 1 apart, the highest at 0, here 2.4 away along every axis.
  const auto value = [](const ScaledParameters& p) -> std::optional<double> {
    double sum = 0.0;
    for (int k = 0; k < 6; ++k) {
      const double x = p[k] - 2.4;
      sum -= x * x + 2.0 * (1.0 - std::cos(2.0 * M_PI * x));
    }
    return sum;
  };
  test::FunctionTarget target(value);
  OptimizerResult result;
  known_optimizer("cma-es").maximize(target, {3.0, 1e-3, 100}, {100000, 7}, result);
  EXPECT_LT((result.point - ScaledParameters::Constant(2.4)).norm(), 0.01);
  test::FunctionTarget other(value);
  OptimizerResult other_key;
  known_optimizer("cma-es").maximize(other, {3.0, 1e-3, 100}, {100000, 8}, other_key);
  EXPECT_NE(other.points[1], target.points[1]);
}

TEST(Optimizers, RefuseUnknownNames) {
  EXPECT_THROW(known_optimizer("unheard-of"), InputError);
}

NewtonOptions newton_options() {
  return {
      Derivatives::NormalEquations,
      20.0,
      kFinalStepMm,
      [](const ScaledParameters& from, const ScaledParameters& to) { return (to - from).norm(); }};
}

TEST(NewtonSearch, TakesFewEvaluationsWithACurvatureThatIsNearlyRight) {
  constexpr double kCondition = 100.0;
  OptimizerResult exact;
  test::FunctionTarget target = quadratic(kCondition);
  newton_search(target, curvature(kCondition), newton_options(), {100, 1}, exact);
  EXPECT_EQ(exact.evaluations, 2);
  EXPECT_EQ(exact.stop_reason, StopReason::StepBelowFinal);
  EXPECT_LT((exact.point - quadratic_optimum()).norm(), 1e-9);
  // Six corrections of rank one make any curvature of six parameters right.
  const ScaledMatrix near = 1.3 * curvature(kCondition) + 2.0 * ScaledMatrix::Identity();
  OptimizerResult learnt;
  newton_search(target, near, newton_options(), {100, 1}, learnt);
  EXPECT_LE(learnt.evaluations, 8);
  EXPECT_LT((learnt.point - quadratic_optimum()).norm(), kFinalStepMm);
}

TEST(NewtonSearch, TakesTheStepForWhichNoBudgetIsLeft) {
  test::FunctionTarget target = quadratic(4.0);
  OptimizerResult result;
  newton_search(target, curvature(4.0), newton_options(), {1, 1}, result);
  EXPECT_EQ(result.stop_reason, StopReason::EvaluationBudgetSpent);
  EXPECT_EQ(result.evaluations, 1);
  EXPECT_EQ(result.trace.size(), 1u);
  EXPECT_LT((result.point - quadratic_optimum()).norm(), 1e-9);
}

TEST(NewtonSearch, TakesShorterStepsWhereValuesFall) {
  // With a curvature of a fifth of the true one, steps go too far.
  test::FunctionTarget target = quadratic(1.0);
  OptimizerResult result;
  newton_search(target, 0.2 * curvature(1.0), newton_options(), {100, 1}, result);
  EXPECT_EQ(result.stop_reason, StopReason::StepBelowFinal);
  EXPECT_LT((result.point - quadratic_optimum()).norm(), kFinalStepMm);
  EXPECT_EQ(result.evaluations, 3);
}

TEST(MeasuredCurvature, IsThatOfAQuadraticAndBendsDownwardsWhereTheTargetDoesNot) {
  constexpr double kCondition = 100.0;
  test::FunctionTarget target = quadratic(kCondition);
  const ScaledMatrix measured = measured_curvature(target, Derivatives::Gradient, 0.2);
  EXPECT_LT((measured - curvature(kCondition)).norm(), 1e-9 * curvature(kCondition).norm());
  // The target's matrix plays the part of the Gauss-Newton curvature.
  ScaledMatrix saddle = ScaledMatrix::Identity();
  saddle(0, 0) = 0.25;
  saddle(2, 2) = -3.0;
  saddle(4, 4) = 7.0;
  test::FunctionTarget bent([](const ScaledParameters&) { return std::optional(0.0); },
                            [&](const ScaledParameters& p) {
                              return TargetValue{0.0, -saddle * p, 2.0 * ScaledMatrix::Identity()};
                            });
  ScaledMatrix downwards = saddle;
  downwards(2, 2) = 2.0 * 0.03;
  downwards(4, 4) = 2.0;
  EXPECT_LT((measured_curvature(bent, Derivatives::NormalEquations, 0.2) - downwards).norm(), 1e-9);
  // Optimisers that use gradients alone know no such matrix.
  test::FunctionTarget only_gradient([](const ScaledParameters&) { return std::optional(0.0); },
                                     [&](const ScaledParameters& p) {
                                       return TargetValue{0.0, -saddle * p};
                                     });
  downwards(2, 2) = saddle.norm() * 1e-6;
  downwards(4, 4) = 7.0;
  EXPECT_LT((measured_curvature(only_gradient, Derivatives::Gradient, 0.2) - downwards).norm(),
            1e-9);
  test::FunctionTarget nowhere = quadratic(kCondition, -1.0);
  EXPECT_EQ(measured_curvature(nowhere, Derivatives::Gradient, 0.2), ScaledMatrix::Identity());
}

}  // namespace
}  // namespace af::registration
