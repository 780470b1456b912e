// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/described_fields.h"

namespace af::registration {

/// Why a search ended.
enum class StopReason {
  StepBelowFinal,         ///< converged: no better point at the final step
  EvaluationBudgetSpent,  ///< max_evaluations reached
  PinnedAtLimit,          ///< converged, but points a final step away are inadmissible
  StartInadmissible,      ///< the field does not hold all rays of the start
  CtOutsideRoi,           ///< no CT point projects into a region of interest: steps undefined
  NonFiniteSimilarity,    ///< the similarity is NaN or infinite
  NoBetterThanNoDrr,      ///< no chain of a portfolio explains the X-rays better than no DRR
};

/// "step-below-final", "evaluation-budget-spent", "pinned-at-limit", "start-inadmissible",
/// "ct-outside-roi", "non-finite-similarity", "no-better-than-no-drr": as in result files.
const char* to_string(StopReason reason);

/// Six pose parameters (rx, ry, rz, tx, ty, tz) scaled so that one unit of each moves projected CT
/// points by 1 mm on average (ParameterScaling).
using ScaledParameters = Eigen::Matrix<double, 6, 1>;
using ScaledMatrix = Eigen::Matrix<double, 6, 6>;

/// The twelve points one step away from a point along one parameter, forth and back.
std::array<ScaledParameters, 12> neighbors(const ScaledParameters& point, double step_mm);

/// What an optimiser asks of its target; each value includes the ones before.
enum class Derivatives {
  None,
  Gradient,         ///< first derivatives
  NormalEquations,  ///< and a positive semi-definite approximation of the negative Hessian
};

/// A target at a point, with the derivatives that were asked for.
struct TargetValue {
  double value = 0.0;
  ScaledParameters gradient = ScaledParameters::Zero();
  ScaledMatrix matrix = ScaledMatrix::Zero();
};

/// What an optimiser maximises.
class OptimizationTarget {
 public:
  virtual ~OptimizationTarget() = default;

  /// nullopt: the point is inadmissible.
  virtual std::optional<double> evaluate(const ScaledParameters& point) = 0;
  /// The same for points that do not depend on each other, as many `values`: targets may evaluate
  /// them at the same time.
  virtual void evaluate_all(std::span<const ScaledParameters> points,
                            std::span<std::optional<double>> values);
  /// With derivatives; only for targets that were made for optimisers that need them.
  virtual std::optional<TargetValue> evaluate_with(const ScaledParameters& point,
                                                   Derivatives derivatives);
  /// The point, or one near it that known limits admit (it may still turn out inadmissible).
  [[nodiscard]] virtual ScaledParameters nearest_admissible(const ScaledParameters& point) const {
    return point;
  }
};

struct OptimizerOptions {
  double initial_step_mm = 5.0;
  double final_step_mm = 0.5;
  int population = 16;

  void describe(Fields& field);
};

/// One accepted move or one change of the step.
struct OptimizerIteration {
  double step_mm = 0.0;  ///< of the points examined
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

/// What one search may spend, and the key of its random numbers.
struct SearchBudget {
  int max_evaluations = 5000;    ///< calls of the target; derivatives do not count extra
  std::uint64_t random_key = 0;  ///< of (seed, case, start); only cma-es draws
};

/// A search from the origin of the scaled parameters. Stateless, hence re-entrant: the same target,
/// options and budget give the same result.
class Optimizer {
 public:
  virtual ~Optimizer() = default;

  [[nodiscard]] virtual Derivatives needs() const { return Derivatives::None; }

  /// `result` is overwritten, its memory reused.
  virtual void maximize(OptimizationTarget& target,
                        const OptimizerOptions& options,
                        const SearchBudget& budget,
                        OptimizerResult& result) const = 0;
};

/// Names that make_optimizer() knows, and one line that explains them.
std::vector<std::string> optimizer_names();
std::string optimizer_help();
/// One line per optimiser: name, what it needs of a measure ("-", "gradient", "normal-equations"),
/// help; tabs between.
std::string optimizer_list();

/// InputError that lists the known names.
std::unique_ptr<Optimizer> make_optimizer(const std::string& name);

}  // namespace af::registration
