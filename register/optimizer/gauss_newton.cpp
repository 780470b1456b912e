// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/gauss_newton.h"

#include <algorithm>

#include <Eigen/Cholesky>

#include "register/optimizer/search_run.h"

namespace af::registration {
namespace {

constexpr double kFirstDamping = 1e-3;
constexpr double kLeastDamping = 1e-6;
constexpr double kDampingFactor = 10.0;

/// A parameter that hardly changes the residuals (a translation along the only view's beam) is
/// damped as if its curvature were this share of the largest one, so that its steps stay finite.
constexpr double kLeastCurvatureShare = 1e-6;

ScaledParameters damped_step(const TargetValue& at, double damping, double longest_mm) {
  const double least = kLeastCurvatureShare * at.matrix.diagonal().maxCoeff();
  ScaledMatrix matrix = at.matrix;
  matrix.diagonal() += damping * at.matrix.diagonal().cwiseMax(least);
  ScaledParameters step = matrix.ldlt().solve(at.gradient);
  if (!step.allFinite()) step = at.gradient;
  const double length = step.norm();
  return length > longest_mm ? ScaledParameters(step * (longest_mm / length)) : step;
}

}  // namespace

void GaussNewton::maximize(OptimizationTarget& target,
                           const OptimizerOptions& options,
                           const SearchBudget& budget,
                           OptimizerResult& result) const {
  SearchRun run(target, budget, result);
  std::optional<TargetValue> at = run.begin(needs());
  if (!at) return;
  double damping = kFirstDamping;
  bool met_limit = false;
  for (;;) {
    const ScaledParameters point = run.stepped(damped_step(*at, damping, options.initial_step_mm));
    const double length = (point - result.point).norm();
    const SearchRun::Evaluation next = run.evaluate(point, needs());
    if (next.outcome == SearchRun::Outcome::Ended) {
      run.trace(length);
      return;
    }
    const bool is_inadmissible = next.outcome == SearchRun::Outcome::Inadmissible;
    if (!is_inadmissible && next.target.value > result.value) {
      run.accept(point, next.target.value);
      at = next.target;
      damping = std::max(damping / kDampingFactor, kLeastDamping);
      met_limit = false;
    } else {
      damping *= kDampingFactor;
      met_limit = is_inadmissible;
    }
    run.trace(length);
    if (length < options.final_step_mm) {
      run.converge(met_limit);
      return;
    }
  }
}

}  // namespace af::registration
