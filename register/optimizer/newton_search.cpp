// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/newton_search.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "register/optimizer/curvature_bounds.h"
#include "register/optimizer/search_run.h"

namespace af::registration {
namespace {

/// Least curvature as a share of the target's own matrix: that of Gauss and Newton, or less where
/// the measure reweights its residuals (PoseTarget). Measured curvatures below this share, or above
/// the matrix, count as errors of the differences.
constexpr double kLeastShareOfGaussNewton = 0.03;

/// Least curvature relative to the largest one, where Gauss and Newton's is unknown.
constexpr double kLeastCurvatureOverLargest = 1e-6;

/// A value lower by this share does not count as worse. Near an optimum, ray sampling errors change
/// values more than the pose does, and the derivatives are more reliable.
constexpr double kValueNoise = 1e-4;

SearchRun::WithDerivatives evaluator(LeastSquaresTarget& target, Derivatives derivatives) {
  return [&target, derivatives](const ScaledParameters& point) {
    return derivatives == Derivatives::Gradient ? target.evaluate_with_gradient(point)
                                                : target.evaluate_with_normal_equations(point);
  };
}

ScaledMatrix bent_downwards(const ScaledMatrix& curvature, const ScaledMatrix& gauss_newton) {
  if (gauss_newton.llt().info() == Eigen::Success)
    return kept_between(curvature, gauss_newton, kLeastShareOfGaussNewton, 1.0);
  const double largest = curvature.norm();
  // No difference could be taken. Steps then follow the gradient until evaluations tell more.
  if (!(largest > 0.0)) return ScaledMatrix::Identity();
  return kept_between(
      curvature, largest * ScaledMatrix::Identity(), kLeastCurvatureOverLargest, 1.0);
}

ScaledParameters newton_step(const ScaledMatrix& curvature,
                             const ScaledParameters& gradient,
                             double longest_mm) {
  ScaledParameters step = curvature.ldlt().solve(gradient);
  if (!step.allFinite()) step = gradient;
  const double length = step.norm();
  return length > longest_mm ? ScaledParameters(step * (longest_mm / length)) : step;
}

/// Corrects the curvature when the gradient fell by `fall` along `step`. Skips a correction after
/// which the target would no longer bend downwards.
void correct_curvature(const ScaledParameters& step,
                       const ScaledParameters& fall,
                       ScaledMatrix& curvature) {
  const ScaledParameters error = fall - curvature * step;
  const double along = error.dot(step);
  if (!(std::abs(along) > 1e-8 * error.norm() * step.norm())) return;
  const ScaledMatrix corrected = curvature + error * error.transpose() / along;
  if (corrected.llt().info() == Eigen::Success) curvature = corrected;
}

}  // namespace

ScaledMatrix measured_curvature(LeastSquaresTarget& target,
                                Derivatives derivatives,
                                double step_mm) {
  ScaledMatrix curvature = ScaledMatrix::Zero();
  const SearchRun::WithDerivatives with = evaluator(target, derivatives);
  const std::optional<TargetValue> here = with(ScaledParameters::Zero());
  for (int k = 0; k < 6; ++k) {
    const ScaledParameters step = step_mm * ScaledParameters::Unit(k);
    const ScaledParameters ahead = target.nearest_admissible(step);
    const ScaledParameters behind = target.nearest_admissible(-step);
    const double way = ahead[k] - behind[k];
    const std::optional<TargetValue> there = with(ahead);
    const std::optional<TargetValue> back = with(behind);
    if (there && back && way > 0.0) curvature.col(k) = (back->gradient - there->gradient) / way;
  }
  return bent_downwards(0.5 * (curvature + curvature.transpose()),
                        here ? here->matrix : ScaledMatrix::Zero());
}

void newton_search(LeastSquaresTarget& target,
                   ScaledMatrix curvature,
                   const NewtonOptions& options,
                   const SearchBudget& budget,
                   OptimizerResult& result) {
  SearchRun run(target, budget, result);
  const SearchRun::WithDerivatives with = evaluator(target, options.derivatives);
  std::optional<TargetValue> at = run.begin(with);
  if (!at) return;
  double longest_mm = options.longest_step_mm;
  for (;;) {
    const ScaledParameters newton = newton_step(curvature, at->gradient, longest_mm);
    const ScaledParameters point = run.stepped(newton);
    const ScaledParameters step = point - result.point;
    const bool met_limit = point != result.point + newton;
    const bool is_last = options.length_mm(result.point, point) <= options.tolerance_mm;
    const bool is_unseen = is_last || result.evaluations >= budget.max_evaluations;
    if (is_unseen) run.accept(point, at->value);
    if (is_last) {
      run.trace(step.norm());
      run.converge(met_limit, 0.0);
      return;
    }
    const SearchRun::Evaluation next = run.evaluate(point, with);
    if (next.outcome == SearchRun::Outcome::Ended) {
      run.trace(step.norm());
      return;
    }
    const bool is_admissible = next.outcome == SearchRun::Outcome::Value;
    if (is_admissible) correct_curvature(step, at->gradient - next.target.gradient, curvature);
    if (is_admissible && next.target.value >= at->value - kValueNoise * std::abs(at->value)) {
      run.accept(point, next.target.value);
      at = next.target;
    } else {
      longest_mm = step.norm() / 2.0;
    }
    run.trace(step.norm());
  }
}

}  // namespace af::registration
