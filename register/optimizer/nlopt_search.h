// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// NLopt's BOBYQA (quadratic models in a trust region: Powell, report DAMTP 2009/NA06) or
/// Nelder-Mead (simplex: Nelder and Mead, Computer Journal 7, 1965; Box, 1965). The first step is
/// initial_step_mm along every parameter. The search has converged when its points are within
/// final_step_mm of each other. They see an inadmissible point as somewhat worse than the worst
/// admissible one. \test NloptSearch.FindsAQuadraticsMaximum
void bobyqa(OptimizationTarget& target,
            const OptimizerOptions& options,
            const SearchBudget& budget,
            OptimizerResult& result);

void nelder_mead(OptimizationTarget& target,
                 const OptimizerOptions& options,
                 const SearchBudget& budget,
                 OptimizerResult& result);

}  // namespace af::registration
