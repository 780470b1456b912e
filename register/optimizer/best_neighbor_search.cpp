// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/best_neighbor_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace af::registration {
namespace {

constexpr int kNeighbors = 12;

ScaledParameters neighbor(const ScaledParameters& point, int index, double step_mm) {
  ScaledParameters moved = point;
  moved[index / 2] += index % 2 == 0 ? -step_mm : step_mm;
  return moved;
}

enum class Examined { Complete, BudgetSpent, NonFinite };

struct Neighborhood {
  Examined examined = Examined::Complete;
  int best_index = -1;  ///< -1: none beats the present point
  double best_value = 0.0;
  bool has_inadmissible = false;
};

Neighborhood examine(OptimizationTarget& target,
                     double step_mm,
                     int max_evaluations,
                     OptimizerResult& result) {
  Neighborhood found;
  found.best_value = result.value;
  for (int index = 0; index < kNeighbors; ++index) {
    if (result.evaluations >= max_evaluations) {
      found.examined = Examined::BudgetSpent;
      return found;
    }
    const std::optional<double> value = target.evaluate(neighbor(result.point, index, step_mm));
    ++result.evaluations;
    if (!value.has_value()) {
      ++result.inadmissible;
      found.has_inadmissible = true;
      continue;
    }
    if (!std::isfinite(*value)) {
      found.examined = Examined::NonFinite;
      return found;
    }
    if (*value > found.best_value) {
      found.best_value = *value;
      found.best_index = index;
    }
  }
  return found;
}

/// False when the search has ended with the start.
bool begin(OptimizationTarget& target, int max_evaluations, OptimizerResult& result) {
  result.point.setZero();
  result.value = std::numeric_limits<double>::quiet_NaN();
  result.evaluations = 0;
  result.inadmissible = 0;
  result.trace.clear();
  if (max_evaluations < 1) {
    result.stop_reason = StopReason::EvaluationBudgetSpent;
    return false;
  }
  const std::optional<double> value = target.evaluate(result.point);
  result.evaluations = 1;
  if (!value.has_value()) {
    result.inadmissible = 1;
    result.stop_reason = StopReason::StartInadmissible;
    return false;
  }
  result.value = *value;
  if (!std::isfinite(*value)) {
    result.stop_reason = StopReason::NonFiniteSimilarity;
    return false;
  }
  return true;
}

}  // namespace

void BestNeighborSearch::maximize(OptimizationTarget& target,
                                  const OptimizerOptions& options,
                                  int max_evaluations,
                                  OptimizerResult& result) const {
  if (!begin(target, max_evaluations, result)) return;
  double step_mm = options.initial_step_mm;
  for (;;) {
    const Neighborhood found = examine(target, step_mm, max_evaluations, result);
    // A spent budget still keeps the best neighbour seen.
    if (found.best_index >= 0) {
      result.point = neighbor(result.point, found.best_index, step_mm);
      result.value = found.best_value;
    }
    result.trace.push_back({step_mm, result.value, result.evaluations, result.point});
    if (found.examined != Examined::Complete) {
      result.stop_reason = found.examined == Examined::BudgetSpent
                               ? StopReason::EvaluationBudgetSpent
                               : StopReason::NonFiniteSimilarity;
      return;
    }
    if (found.best_index >= 0) continue;
    if (step_mm <= options.final_step_mm) {
      result.stop_reason =
          found.has_inadmissible ? StopReason::PinnedAtLimit : StopReason::StepBelowFinal;
      return;
    }
    step_mm = std::max(step_mm / 2.0, options.final_step_mm);
  }
}

}  // namespace af::registration
