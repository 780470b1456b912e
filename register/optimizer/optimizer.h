// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace af::registration {

/// Why a search ended.
enum class StopReason {
  StepBelowFinal,         ///< converged: no neighbour at the final step is better
  EvaluationBudgetSpent,  ///< max_evaluations reached
  PinnedAtLimit,          ///< converged, but a neighbour at the final step is inadmissible
  StartInadmissible,      ///< the start lies outside the field or its motion range
  CtOutsideRoi,           ///< no CT point projects into a region of interest: steps undefined
  NonFiniteSimilarity,    ///< the similarity is NaN or infinite
};

/// "step-below-final", "evaluation-budget-spent", "pinned-at-limit", "start-inadmissible",
/// "ct-outside-roi", "non-finite-similarity": as in result files.
const char* to_string(StopReason reason);

/// Six pose parameters (rx, ry, rz, tx, ty, tz) scaled so that one unit of each moves projected CT
/// points by 1 mm on average (ParameterScaling).
using ScaledParameters = Eigen::Matrix<double, 6, 1>;

/// What an optimiser maximises.
class OptimizationTarget {
 public:
  virtual ~OptimizationTarget() = default;

  /// nullopt: the point is inadmissible.
  virtual std::optional<double> evaluate(const ScaledParameters& point) = 0;
};

struct OptimizerOptions {
  double initial_step_mm = 5.0;
  double final_step_mm = 0.5;
};

std::vector<std::string> problems(const OptimizerOptions& options);

/// One accepted move or one change of the step.
struct OptimizerIteration {
  double step_mm = 0.0;  ///< step of the neighbours examined
  double value = 0.0;    ///< best value after the iteration
  int evaluations = 0;   ///< so far, this search
  ScaledParameters point = ScaledParameters::Zero();
};

struct OptimizerResult {
  ScaledParameters point = ScaledParameters::Zero();
  double value = 0.0;  ///< NaN when the start is inadmissible
  int evaluations = 0;
  int inadmissible = 0;  ///< of these, points that were inadmissible
  StopReason stop_reason = StopReason::StepBelowFinal;
  std::vector<OptimizerIteration> trace;
};

/// A local search from the origin of the scaled parameters. Stateless, hence re-entrant; draws no
/// random numbers.
class Optimizer {
 public:
  virtual ~Optimizer() = default;

  /// At most `max_evaluations` calls of target.evaluate(); `result` is overwritten, its memory
  /// reused.
  virtual void maximize(OptimizationTarget& target,
                        const OptimizerOptions& options,
                        int max_evaluations,
                        OptimizerResult& result) const = 0;
};

/// Names that make_optimizer() knows.
std::vector<std::string> optimizer_names();

/// InputError that lists the known names.
std::unique_ptr<Optimizer> make_optimizer(const std::string& name);

}  // namespace af::registration
