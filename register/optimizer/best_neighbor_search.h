// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// The paper's optimiser (Sec. III-B2): of the 12 neighbours (one step down and one up along each
/// parameter: -rx, +rx, -ry, ... +tz) move to the best when it beats the present point, ties going
/// to the first in that order; otherwise halve the step, the last step being final_step_mm exactly.
/// Inadmissible neighbours are passed over. \test
/// BestNeighborSearch.FindsAQuadraticsMaximumToTheFinalStep
void best_neighbor_search(OptimizationTarget& target,
                          const OptimizerOptions& options,
                          const SearchBudget& budget,
                          OptimizerResult& result);

}  // namespace af::registration
