// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// L-BFGS with a backtracking line search (Nocedal and Wright, Numerical Optimization, 2nd ed.,
/// Algorithms 7.4 and 3.1): the direction comes from the last six changes of the gradient, steps
/// are no longer than initial_step_mm, halved until the value rises enough and the point is
/// admissible, and the search has converged when they fall below final_step_mm.
/// \test GradientAscent.FindsAnIllConditionedMaximum
class GradientAscent final : public Optimizer {
 public:
  [[nodiscard]] Derivatives needs() const override { return Derivatives::Gradient; }
  void maximize(OptimizationTarget& target,
                const OptimizerOptions& options,
                const SearchBudget& budget,
                OptimizerResult& result) const override;
};

}  // namespace af::registration
