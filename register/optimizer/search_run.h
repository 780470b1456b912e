// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// The bookkeeping that all optimisers share: counts, budget, best point, trace and why the search
/// ended.
class SearchRun {
 public:
  /// Resets `result`.
  SearchRun(OptimizationTarget& target, const SearchBudget& budget, OptimizerResult& result);

  /// Evaluates the start (the origin), which becomes the best point. nullopt: the search has ended.
  std::optional<TargetValue> begin(Derivatives derivatives);

  /// What evaluate() found.
  enum class Outcome { Value, Inadmissible, Ended };
  struct Evaluation {
    Outcome outcome = Outcome::Ended;
    TargetValue target;
  };
  /// One evaluation; Ended when the budget is spent or the value is not finite, which the result
  /// then says.
  Evaluation evaluate(const ScaledParameters& point, Derivatives derivatives = Derivatives::None);

  /// The point that a step from the best one leads to, inside known limits.
  [[nodiscard]] ScaledParameters stepped(const ScaledParameters& step) const {
    return target_.nearest_admissible(result_.point + step);
  }

  /// Makes a point the best one.
  void accept(const ScaledParameters& point, double value);
  /// The same when it beats the best.
  void offer(const ScaledParameters& point, double value);
  void trace(double step_mm);
  /// Converged: pinned when the points that could have been better were inadmissible.
  void converge(bool met_limit);

  [[nodiscard]] const OptimizerResult& result() const { return result_; }

 private:
  OptimizationTarget& target_;
  SearchBudget budget_;
  OptimizerResult& result_;
};

}  // namespace af::registration
