// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// Covariance matrix adaptation (Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772,
/// with its default constants), for wide starts and rough targets. The first standard deviation is
/// initial_step_mm. The search has converged when the largest one falls below final_step_mm. An
/// inadmissible point ranks last. Random numbers are counter-based, keyed by budget.random_key: the
/// same key gives the same search. \test CmaEs.FindsTheHighestOfManyPeaks
void cma_es(OptimizationTarget& target,
            const OptimizerOptions& options,
            const SearchBudget& budget,
            OptimizerResult& result);

}  // namespace af::registration
