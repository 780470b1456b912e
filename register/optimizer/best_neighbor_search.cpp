// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/best_neighbor_search.h"

#include <algorithm>
#include <optional>

#include "register/optimizer/search_run.h"

namespace af::registration {
namespace {

struct Neighborhood {
  bool is_complete = true;               ///< false: the search has ended
  std::optional<ScaledParameters> best;  ///< none beats the current point
  double best_value = 0.0;
  bool has_inadmissible = false;
};

Neighborhood examine(SearchRun& run, double step_mm) {
  Neighborhood found;
  found.best_value = run.result().value;
  const auto points = neighbors(run.result().point, step_mm);
  const ScaledParameters* point = points.data();
  for (const SearchRun::Evaluation& evaluation : run.evaluate_all(points)) {
    if (evaluation.outcome == SearchRun::Outcome::Ended) {
      found.is_complete = false;
      return found;
    }
    if (evaluation.outcome == SearchRun::Outcome::Inadmissible) {
      found.has_inadmissible = true;
    } else if (evaluation.target.value > found.best_value) {
      found.best_value = evaluation.target.value;
      found.best = *point;
    }
    ++point;
  }
  return found;
}

}  // namespace

void best_neighbor_search(OptimizationTarget& target,
                          const OptimizerOptions& options,
                          const SearchBudget& budget,
                          OptimizerResult& result) {
  SearchRun run(target, budget, result);
  if (!run.begin()) return;
  double step_mm = options.initial_step_mm;
  for (;;) {
    const Neighborhood found = examine(run, step_mm);
    // A spent budget still keeps the best neighbour seen.
    if (found.best) run.accept(*found.best, found.best_value);
    run.trace(step_mm);
    if (!found.is_complete) return;
    if (found.best) continue;
    if (step_mm <= options.final_step_mm) {
      run.converge(found.has_inadmissible, options.final_step_mm);
      return;
    }
    step_mm = std::max(step_mm / 2.0, options.final_step_mm);
  }
}

}  // namespace af::registration
