// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// The bookkeeping that all optimisers share: counts, budget, best point, trace, and why the search
/// ended.
class SearchRun {
 public:
  /// Resets `result`.
  SearchRun(OptimizationTarget& target, const SearchBudget& budget, OptimizerResult& result);

  /// Evaluates a target at a point with derivatives. nullopt: it is inadmissible.
  using WithDerivatives = std::function<std::optional<TargetValue>(const ScaledParameters& point)>;

  /// Evaluates the start (the origin), which becomes the best point. nullopt: the search has ended.
  std::optional<TargetValue> begin(const WithDerivatives& with = {});

  /// The outcome of evaluate().
  enum class Outcome { Value, Inadmissible, Ended };
  struct Evaluation {
    Outcome outcome = Outcome::Ended;
    TargetValue target;
  };
  /// Evaluates one point. The outcome is Ended, with the reason in the result, when the budget is
  /// spent or the value is not finite. Without `with`, only its value.
  Evaluation evaluate(const ScaledParameters& point, const WithDerivatives& with = {});
  /// The same, without derivatives, for independent points. They are counted in order: after a
  /// point that ends the search, all others are Ended.
  std::span<const Evaluation> evaluate_all(std::span<const ScaledParameters> points);

  /// The point one step from the best one, inside known limits.
  [[nodiscard]] ScaledParameters stepped(const ScaledParameters& step) const {
    return target_.nearest_admissible(result_.point + step);
  }

  /// Makes a point the best one.
  void accept(const ScaledParameters& point, double value);
  /// The same if it beats the best.
  void offer(const ScaledParameters& point, double value);
  void trace(double step_mm);
  /// Ends a search that has converged. It is pinned when the points that could have been better
  /// were inadmissible, or when a step of `final_step_mm` along a parameter leads beyond known
  /// limits.
  void converge(bool met_limit, double final_step_mm);

  [[nodiscard]] const OptimizerResult& result() const { return result_; }

 private:
  /// Whether the budget allows one more evaluation. If not, the result says so.
  bool has_budget();
  /// Counts an evaluation and returns its outcome.
  Evaluation counted(const std::optional<TargetValue>& found);

  OptimizationTarget& target_;
  SearchBudget budget_;
  OptimizerResult& result_;
  std::vector<std::optional<double>> values_;  ///< reused
  std::vector<Evaluation> evaluations_;        ///< reused
};

}  // namespace af::registration
