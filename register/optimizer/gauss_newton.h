// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// The curvature that normal equations leave out, learned from accepted steps.
///
/// DRRs are not linear in the pose, so that where residuals are large the target curves otherwise
/// than its matrix says, and steps by this alone converge only linearly. The difference follows
/// from the gradients on either side of a step, by symmetric rank-one updates: a structured
/// quasi-Newton method (Dennis, Gay and Welsch, An Adaptive Nonlinear Least-Squares Algorithm, ACM
/// TOMS 7(3), 1981; Nocedal and Wright, Numerical Optimization, 2006, eq. (6.24)).
class LearnedCurvature {
 public:
  [[nodiscard]] bool is_empty() const { return is_empty_; }
  void clear();

  /// Learns from a step between two points with gradients and normal equations.
  void learn(const ScaledParameters& step, const TargetValue& before, const TargetValue& after);

  /// The normal equations `matrix` (positive definite) with what was learned. Along every direction
  /// the curvature stays within 1/3 and 3 of the matrix's: a step is at most three times as long.
  [[nodiscard]] ScaledMatrix added_to(const ScaledMatrix& matrix) const;

 private:
  ScaledMatrix missing_ = ScaledMatrix::Zero();
  bool is_empty_ = true;
};

/// Levenberg and Marquardt on the normal equations of a sum of squares (Madsen, Nielsen, Tingleff,
/// Methods for Non-Linear Least Squares Problems, 2004, Sec. 3.2): the step solves (H + lambda
/// diag H) h = g and is no longer than initial_step_mm; a better point lowers lambda; after a worse
/// or inadmissible one, and another try without what was learned, lambda rises until the step,
/// before limits trim it, is at most half as long, which also turns it; until a step falls below
/// final_step_mm. \test GaussNewton.EndsAQuadraticInAFewSteps,
/// GaussNewton.HalvesRejectedStepsAtLeast, QuasiNewton.LearnsMissingCurvature
void gauss_newton(LeastSquaresTarget& target,
                  const OptimizerOptions& options,
                  const SearchBudget& budget,
                  OptimizerResult& result);

/// The same with the curvature that steps teach (LearnedCurvature).
void quasi_newton(LeastSquaresTarget& target,
                  const OptimizerOptions& options,
                  const SearchBudget& budget,
                  OptimizerResult& result);

}  // namespace af::registration
