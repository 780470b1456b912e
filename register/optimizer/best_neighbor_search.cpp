// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/best_neighbor_search.h"

#include <algorithm>
#include <array>

#include "register/optimizer/search_run.h"

namespace af::registration {
namespace {

constexpr int kNeighbors = 12;

ScaledParameters neighbor(const ScaledParameters& point, int index, double step_mm) {
  ScaledParameters moved = point;
  moved[index / 2] += index % 2 == 0 ? -step_mm : step_mm;
  return moved;
}

struct Neighborhood {
  bool is_complete = true;  ///< false: the search has ended
  int best_index = -1;      ///< -1: none beats the present point
  double best_value = 0.0;
  bool has_inadmissible = false;
};

Neighborhood examine(SearchRun& run, double step_mm) {
  Neighborhood found;
  found.best_value = run.result().value;
  std::array<ScaledParameters, kNeighbors> points;
  for (int index = 0; index < kNeighbors; ++index)
    points[static_cast<std::size_t>(index)] = neighbor(run.result().point, index, step_mm);
  int index = 0;
  for (const SearchRun::Evaluation& evaluation : run.evaluate_all(points)) {
    if (evaluation.outcome == SearchRun::Outcome::Ended) {
      found.is_complete = false;
      return found;
    }
    if (evaluation.outcome == SearchRun::Outcome::Inadmissible) {
      found.has_inadmissible = true;
    } else if (evaluation.target.value > found.best_value) {
      found.best_value = evaluation.target.value;
      found.best_index = index;
    }
    ++index;
  }
  return found;
}

}  // namespace

void BestNeighborSearch::maximize(OptimizationTarget& target,
                                  const OptimizerOptions& options,
                                  const SearchBudget& budget,
                                  OptimizerResult& result) const {
  SearchRun run(target, budget, result);
  if (!run.begin(Derivatives::None)) return;
  double step_mm = options.initial_step_mm;
  for (;;) {
    const Neighborhood found = examine(run, step_mm);
    // A spent budget still keeps the best neighbour seen.
    if (found.best_index >= 0)
      run.accept(neighbor(result.point, found.best_index, step_mm), found.best_value);
    run.trace(step_mm);
    if (!found.is_complete) return;
    if (found.best_index >= 0) continue;
    if (step_mm <= options.final_step_mm) {
      run.converge(found.has_inadmissible);
      return;
    }
    step_mm = std::max(step_mm / 2.0, options.final_step_mm);
  }
}

}  // namespace af::registration
