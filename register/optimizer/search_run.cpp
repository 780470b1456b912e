// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/search_run.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace af::registration {
namespace {

std::optional<TargetValue> value_alone(const std::optional<double>& value) {
  return value.has_value() ? std::optional(TargetValue{*value}) : std::nullopt;
}

}  // namespace

SearchRun::SearchRun(OptimizationTarget& target,
                     const SearchBudget& budget,
                     OptimizerResult& result)
    : target_(target), budget_(budget), result_(result) {
  result_.point.setZero();
  result_.value = std::numeric_limits<double>::quiet_NaN();
  result_.evaluations = 0;
  result_.inadmissible = 0;
  result_.stop_reason = StopReason::StepBelowFinal;
  result_.trace.clear();
}

std::optional<TargetValue> SearchRun::begin(const WithDerivatives& with) {
  const Evaluation start = evaluate(ScaledParameters::Zero(), with);
  if (start.outcome == Outcome::Inadmissible) result_.stop_reason = StopReason::StartInadmissible;
  if (start.outcome != Outcome::Value) return std::nullopt;
  result_.value = start.target.value;
  return start.target;
}

bool SearchRun::has_budget() {
  if (result_.evaluations < budget_.max_evaluations) return true;
  result_.stop_reason = StopReason::EvaluationBudgetSpent;
  return false;
}

SearchRun::Evaluation SearchRun::counted(const std::optional<TargetValue>& found) {
  ++result_.evaluations;
  if (!found.has_value()) {
    ++result_.inadmissible;
    return {Outcome::Inadmissible, {}};
  }
  if (!std::isfinite(found->value) || !found->gradient.allFinite()) {
    // A start without a finite value is still reported with its value.
    if (result_.evaluations == 1) result_.value = found->value;
    result_.stop_reason = StopReason::NonFiniteSimilarity;
    return {};
  }
  return {Outcome::Value, *found};
}

SearchRun::Evaluation SearchRun::evaluate(const ScaledParameters& point,
                                          const WithDerivatives& with) {
  if (!has_budget()) return {};
  return counted(with ? with(point) : value_alone(target_.evaluate(point)));
}

std::span<const SearchRun::Evaluation> SearchRun::evaluate_all(
    std::span<const ScaledParameters> points) {
  const auto left =
      static_cast<std::size_t>(std::max(0, budget_.max_evaluations - result_.evaluations));
  const std::size_t count = std::min(points.size(), left);
  values_.assign(count, std::nullopt);
  target_.evaluate_all(points.first(count), values_);
  evaluations_.assign(points.size(), {});
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!has_budget()) break;
    evaluations_[i] = counted(value_alone(values_[i]));
    if (evaluations_[i].outcome == Outcome::Ended) break;
  }
  return evaluations_;
}

void SearchRun::accept(const ScaledParameters& point, double value) {
  result_.point = point;
  result_.value = value;
}

void SearchRun::offer(const ScaledParameters& point, double value) {
  if (value > result_.value) accept(point, value);
}

void SearchRun::trace(double step_mm) {
  result_.trace.push_back({step_mm, result_.value, result_.evaluations, result_.point});
}

void SearchRun::converge(bool met_limit, double final_step_mm) {
  const bool is_pinned =
      met_limit || std::ranges::any_of(neighbors(result_.point, final_step_mm),
                                       [&](const ScaledParameters& neighbor) {
                                         return target_.nearest_admissible(neighbor) != neighbor;
                                       });
  result_.stop_reason = is_pinned ? StopReason::PinnedAtLimit : StopReason::StepBelowFinal;
}

}  // namespace af::registration
