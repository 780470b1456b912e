// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// L-BFGS with a backtracking line search (Nocedal and Wright, Numerical Optimization, 2nd ed.,
/// Algorithms 7.4 and 3.1). The direction comes from the last six changes of the gradient. Steps
/// are no longer than initial_step_mm, and are halved until the value rises enough and the point is
/// admissible. The search has converged when they fall below final_step_mm.
/// \test GradientAscent.FindsAnIllConditionedMaximum
void gradient_ascent(DifferentiableTarget& target,
                     const OptimizerOptions& options,
                     const SearchBudget& budget,
                     OptimizerResult& result);

}  // namespace af::registration
