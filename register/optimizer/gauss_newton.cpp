// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/gauss_newton.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "register/optimizer/curvature_bounds.h"
#include "register/optimizer/search_run.h"

namespace af::registration {
namespace {

/// An update whose divisor is smaller, relative to its vectors, would be mostly rounding.
constexpr double kLeastCosine = 1e-3;

/// Longer steps were rejected too often, because gradients say little about an optimum far away.
constexpr double kLeastShare = 1.0 / 3.0;
constexpr double kMostShare = 3.0;

constexpr double kFirstDamping = 1e-3;
constexpr double kLeastDamping = 1e-6;
constexpr double kMostDamping = 1e12;
constexpr double kDampingFactor = 10.0;

/// A parameter that hardly changes the residuals (a translation along the only view's beam) is
/// damped as if its curvature were this share of the largest one. That keeps its steps finite.
constexpr double kLeastCurvatureShare = 1e-6;

/// The curvature that normal equations leave out, learned from accepted steps.
///
/// DRRs are not linear in the pose. Where residuals are large, the target therefore curves
/// differently from its matrix, and steps by the matrix alone converge only linearly. The
/// difference follows from the gradients on both sides of a step, by symmetric rank-one updates: a
/// structured quasi-Newton method (Dennis, Gay and Welsch, An Adaptive Nonlinear Least-Squares
/// Algorithm, ACM TOMS 7(3), 1981; Nocedal and Wright, Numerical Optimization, 2006, eq. (6.24)).
class LearnedCurvature {
 public:
  [[nodiscard]] bool is_empty() const { return is_empty_; }
  void clear();

  /// Learns from a step between two points with gradients and normal equations.
  void learn(const ScaledParameters& step, const TargetValue& before, const TargetValue& after);

  /// The normal equations `matrix` (positive definite) plus what was learned. Along every direction
  /// the curvature stays within 1/3 and 3 of the matrix's, so a step is at most three times as
  /// long.
  [[nodiscard]] ScaledMatrix added_to(const ScaledMatrix& matrix) const;

 private:
  ScaledMatrix missing_ = ScaledMatrix::Zero();
  bool is_empty_ = true;
};

void LearnedCurvature::clear() {
  missing_.setZero();
  is_empty_ = true;
}

void LearnedCurvature::learn(const ScaledParameters& step,
                             const TargetValue& before,
                             const TargetValue& after) {
  const ScaledParameters unexplained =
      before.gradient - after.gradient - (after.matrix + missing_) * step;
  const double along = unexplained.dot(step);
  if (!(std::abs(along) > kLeastCosine * unexplained.norm() * step.norm())) return;
  missing_ += unexplained * unexplained.transpose() / along;
  is_empty_ = false;
}

ScaledMatrix LearnedCurvature::added_to(const ScaledMatrix& matrix) const {
  if (is_empty_) return matrix;
  return kept_between(matrix + missing_, matrix, kLeastShare, kMostShare);
}

ScaledParameters damped_step(const TargetValue& at,
                             const LearnedCurvature& learned,
                             double damping,
                             double longest_mm) {
  const double least = kLeastCurvatureShare * at.matrix.diagonal().maxCoeff();
  ScaledMatrix matrix = at.matrix;
  matrix.diagonal() += damping * at.matrix.diagonal().cwiseMax(least);
  ScaledParameters step = learned.added_to(matrix).ldlt().solve(at.gradient);
  if (!step.allFinite()) step = at.gradient;
  const double length = step.norm();
  return length > longest_mm ? ScaledParameters(step * (longest_mm / length)) : step;
}

/// Damping after a rejected step, without what was learned. It is raised until a step is at most
/// half as long: a small rise hardly changes a step, which would be evaluated and rejected again.
double raised_damping(const TargetValue& at, double damping, double rejected_mm) {
  do damping *= kDampingFactor;
  while (damping < kMostDamping &&
         damped_step(at, LearnedCurvature(), damping, rejected_mm).norm() > rejected_mm / 2.0);
  return damping;
}

/// `learns`: whether to learn curvature from the steps too.
void damped_newton(LeastSquaresTarget& target,
                   const OptimizerOptions& options,
                   const SearchBudget& budget,
                   bool learns,
                   OptimizerResult& result) {
  SearchRun run(target, budget, result);
  const SearchRun::WithDerivatives with_equations = [&](const ScaledParameters& point) {
    return target.evaluate_with_normal_equations(point);
  };
  std::optional<TargetValue> at = run.begin(with_equations);
  if (!at) return;
  LearnedCurvature learned;
  double damping = kFirstDamping;
  bool met_limit = false;
  for (;;) {
    const ScaledParameters wanted = damped_step(*at, learned, damping, options.initial_step_mm);
    const ScaledParameters point = run.stepped(wanted);
    const ScaledParameters step = point - result.point;
    // No step follows the last one, so it needs no derivatives.
    const bool is_last = step.norm() < options.final_step_mm;
    const SearchRun::Evaluation next =
        is_last ? run.evaluate(point) : run.evaluate(point, with_equations);
    if (next.outcome == SearchRun::Outcome::Ended) {
      run.trace(step.norm());
      return;
    }
    const bool is_inadmissible = next.outcome == SearchRun::Outcome::Inadmissible;
    if (!is_inadmissible && next.target.value > result.value) {
      run.accept(point, next.target.value);
      if (learns && !is_last) learned.learn(step, *at, next.target);
      at = next.target;
      damping = std::max(damping / kDampingFactor, kLeastDamping);
      met_limit = false;
    } else {
      // What was learned may have made the step too long, so it is dropped first.
      if (learned.is_empty()) damping = raised_damping(*at, damping, wanted.norm());
      learned.clear();
      met_limit = is_inadmissible;
    }
    run.trace(step.norm());
    if (is_last) {
      run.converge(met_limit, options.final_step_mm);
      return;
    }
  }
}

}  // namespace

void gauss_newton(LeastSquaresTarget& target,
                  const OptimizerOptions& options,
                  const SearchBudget& budget,
                  OptimizerResult& result) {
  damped_newton(target, options, budget, false, result);
}

void quasi_newton(LeastSquaresTarget& target,
                  const OptimizerOptions& options,
                  const SearchBudget& budget,
                  OptimizerResult& result) {
  damped_newton(target, options, budget, true, result);
}

}  // namespace af::registration
