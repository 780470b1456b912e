// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// The paper's optimiser (Sec. III-B2). Of the 12 neighbours (one step down and one up along each
/// parameter: -rx, +rx, -ry, ... +tz) it moves to the best when that beats the current point, and
/// to the first in that order when several are equal. Otherwise it halves the step. The last step
/// is exactly final_step_mm. Inadmissible neighbours are skipped. \test
/// BestNeighborSearch.FindsAQuadraticsMaximumToTheFinalStep
void best_neighbor_search(OptimizationTarget& target,
                          const OptimizerOptions& options,
                          const SearchBudget& budget,
                          OptimizerResult& result);

}  // namespace af::registration
