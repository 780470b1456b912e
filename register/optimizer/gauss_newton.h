// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// Levenberg and Marquardt on the normal equations of a sum of squares (Madsen, Nielsen, Tingleff,
/// Methods for Non-Linear Least Squares Problems, 2004, Sec. 3.2): the step solves (H + lambda
/// diag H) h = g and is no longer than initial_step_mm; a better point lowers lambda, a worse or
/// inadmissible one raises it, which shortens and turns the step, until it falls below
/// final_step_mm. \test GaussNewton.EndsAQuadraticInAFewSteps, QuasiNewton.LearnsMissingCurvature
class GaussNewton final : public Optimizer {
 public:
  /// Where the curvature of a step comes from.
  enum class Curvature {
    NormalEquations,
    Learned,  ///< and from the steps so far (LearnedCurvature)
  };
  explicit GaussNewton(Curvature curvature) : curvature_(curvature) {}

  [[nodiscard]] Derivatives needs() const override { return Derivatives::NormalEquations; }
  void maximize(OptimizationTarget& target,
                const OptimizerOptions& options,
                const SearchBudget& budget,
                OptimizerResult& result) const override;

 private:
  Curvature curvature_;
};

}  // namespace af::registration
