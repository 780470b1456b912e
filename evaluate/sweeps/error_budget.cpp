// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/error_budget.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "geometry/tre.h"

namespace af::evaluation {
namespace {

/// Distances between poses that are given relative to gold.
class TargetDistance {
 public:
  TargetDistance(const PoseFrame& gold, std::span<const Eigen::Vector3d> points_ct_mm)
      : gold_(gold), points_ct_mm_(points_ct_mm) {}

  double operator()(const PoseParameters& a, const PoseParameters& b) const {
    return mean_tre_mm(
        pose_from_parameters(gold_, a), pose_from_parameters(gold_, b), points_ct_mm_);
  }

 private:
  const PoseFrame& gold_;
  std::span<const Eigen::Vector3d> points_ct_mm_;
};

PoseParameters mean_of(const std::vector<PoseParameters>& values) {
  PoseParameters sum;
  for (const PoseParameters& value : values) {
    sum.rotation_rad += value.rotation_rad;
    sum.translation_mm += value.translation_mm;
  }
  const auto count = static_cast<double>(values.size());
  return {sum.rotation_rad / count, sum.translation_mm / count};
}

PoseParameters difference(const PoseParameters& a, const PoseParameters& b) {
  return {a.rotation_rad - b.rotation_rad, a.translation_mm - b.translation_mm};
}

std::vector<std::size_t> common_starts(std::span<const BudgetRun> runs) {
  std::vector<std::size_t> common;
  for (std::size_t start = 0; start < runs.front().ends.size(); ++start)
    if (std::all_of(runs.begin(), runs.end(), [&](const BudgetRun& run) {
          return run.ends[start].has_value();
        }))
      common.push_back(start);
  return common;
}

std::vector<PoseParameters> ends_of(const BudgetRun& run, const std::vector<std::size_t>& starts) {
  std::vector<PoseParameters> ends;
  ends.reserve(starts.size());
  for (const std::size_t start : starts) ends.push_back(*run.ends[start]);
  return ends;
}

BudgetStep step_of(const BudgetRun& run,
                   const std::vector<PoseParameters>& ends,
                   const TargetDistance& distance) {
  BudgetStep step;
  step.label = run.label;
  step.starts = run.ends.size();
  step.successes = static_cast<std::size_t>(std::count_if(
      run.ends.begin(), run.ends.end(), [](const auto& end) { return end.has_value(); }));
  step.mean_end = mean_of(ends);
  step.bias_mm = distance(step.mean_end, {});
  const auto count = static_cast<double>(ends.size());
  for (const PoseParameters& end : ends) {
    step.scatter_mm += distance(end, step.mean_end) / count;
    step.tre_mm += distance(end, {}) / count;
  }
  step.shift_mm = step.shift_standard_error_mm = std::numeric_limits<double>::quiet_NaN();
  return step;
}

/// Standard error of the mean change. Its differences are paired, because the starts are the same.
double standard_error_mm(const std::vector<PoseParameters>& ends,
                         const std::vector<PoseParameters>& previous,
                         const TargetDistance& distance) {
  std::vector<PoseParameters> changes;
  for (std::size_t i = 0; i < ends.size(); ++i) changes.push_back(difference(ends[i], previous[i]));
  const PoseParameters mean_change = mean_of(changes);
  double squares = 0.0;
  for (const PoseParameters& change : changes)
    squares += std::pow(distance(change, mean_change), 2);
  const auto count = static_cast<double>(changes.size());
  return std::sqrt(squares / (count * (count - 1.0)));
}

}  // namespace

ErrorBudget error_budget(std::span<const BudgetRun> runs,
                         const PoseFrame& gold,
                         std::span<const Eigen::Vector3d> target_points_ct_mm) {
  if (runs.size() < 2) throw InputError("error budget: needs two or more runs");
  for (const BudgetRun& run : runs)
    if (run.ends.size() != runs.front().ends.size())
      throw InputError(
          run.label, std::to_string(run.ends.size()) + " starts", "must be the same for all runs");
  const std::vector<std::size_t> starts = common_starts(runs);
  if (starts.size() < 2)
    throw InputError("error budget: the runs have " + std::to_string(starts.size()) +
                     " starts from which all of them succeeded; two are needed");
  const TargetDistance distance(gold, target_points_ct_mm);
  ErrorBudget budget;
  budget.common_starts = starts.size();
  std::vector<PoseParameters> previous;
  for (const BudgetRun& run : runs) {
    const std::vector<PoseParameters> ends = ends_of(run, starts);
    BudgetStep step = step_of(run, ends, distance);
    if (!previous.empty()) {
      step.shift_mm = distance(step.mean_end, budget.steps.back().mean_end);
      step.shift_standard_error_mm = standard_error_mm(ends, previous, distance);
    }
    budget.steps.push_back(step);
    previous = ends;
  }
  return budget;
}

}  // namespace af::evaluation
