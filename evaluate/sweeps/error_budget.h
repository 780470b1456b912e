// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/rigid_transform.h"

namespace af::evaluation {

/// The ends of one way of registering, from a table of starts that all ways share.
struct BudgetRun {
  std::string label;  ///< how it differs from the run before
  /// Per start, relative to the gold pose; nullopt where the start did not succeed.
  std::vector<std::optional<PoseParameters>> ends;
};

/// The effect of one change. Distances are mean TREs (mm) between two poses over the target points.
struct BudgetStep {
  std::string label;
  std::size_t starts = 0;
  std::size_t successes = 0;
  PoseParameters mean_end;  ///< over the common starts, relative to gold
  double bias_mm = 0.0;     ///< from the gold pose to the mean end: the systematic error
  double scatter_mm = 0.0;  ///< from the mean end to an end, on average: the optimiser's
  double tre_mm = 0.0;      ///< from the gold pose to an end, on average: both
  double shift_mm = 0.0;    ///< from the previous run's mean end to this one; NaN for the first
  double shift_standard_error_mm = 0.0;  ///< of the shift, from the spread over the starts
};

struct ErrorBudget {
  /// Starts from which every run succeeded. Only these count in what follows `successes`.
  std::size_t common_starts = 0;
  std::vector<BudgetStep> steps;
};

/// Walks through a chain of runs, each of which differs from the one before in one thing, and tells
/// how far each change moves the mean end. As signed parameters, these shifts add up exactly to the
/// bias of the last run. Throws InputError for fewer than two runs, unequal numbers of starts, no
/// target points, or fewer than two common starts.
/// \test ErrorBudget.OfHandBuiltEndsIsTheKnownOne
ErrorBudget error_budget(std::span<const BudgetRun> runs,
                         const PoseFrame& gold,
                         std::span<const Eigen::Vector3d> target_points_ct_mm);

}  // namespace af::evaluation
