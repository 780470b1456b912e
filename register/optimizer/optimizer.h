// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "base/described_fields.h"

namespace af::registration {

/// Why a search ended.
enum class StopReason {
  StepBelowFinal,         ///< converged: no better point at the final step
  EvaluationBudgetSpent,  ///< max_evaluations reached
  PinnedAtLimit,          ///< converged, but points a final step away are inadmissible
  StartInadmissible,      ///< the field does not hold all rays at the start
  CtOutsideRoi,           ///< no CT point projects into a region of interest: steps undefined
  NonFiniteSimilarity,    ///< the similarity is NaN or infinite
  NoBetterThanNoDrr,      ///< no chain of a portfolio explains the X-rays better than no DRR
};

/// The names in result files: "step-below-final", "evaluation-budget-spent", "pinned-at-limit",
/// "start-inadmissible", "ct-outside-roi", "non-finite-similarity", "no-better-than-no-drr".
const char* to_string(StopReason reason);

/// Six pose parameters (rx, ry, rz, tx, ty, tz) scaled so that one unit of each moves projected CT
/// points by 1 mm on average (ParameterScaling).
using ScaledParameters = Eigen::Matrix<double, 6, 1>;
using ScaledMatrix = Eigen::Matrix<double, 6, 6>;

/// The twelve points one step away from a point along one parameter, back and forth.
std::array<ScaledParameters, 12> neighbors(const ScaledParameters& point, double step_mm);

/// What an optimiser asks of its target.
enum class Derivatives {
  None,
  Gradient,         ///< first derivatives
  NormalEquations,  ///< and a positive semi-definite approximation of the negative Hessian
};

/// The value of a target at a point, with the requested derivatives.
struct TargetValue {
  double value = 0.0;
  ScaledParameters gradient = ScaledParameters::Zero();
  ScaledMatrix matrix = ScaledMatrix::Zero();
};

/// What an optimiser maximises.
class OptimizationTarget {
 public:
  virtual ~OptimizationTarget() = default;

  /// nullopt when the point is inadmissible.
  virtual std::optional<double> evaluate(const ScaledParameters& point) = 0;
  /// The same for independent points, one of `values` each. Targets may evaluate them concurrently.
  virtual void evaluate_all(std::span<const ScaledParameters> points,
                            std::span<std::optional<double>> values);
  /// The point, or one near it within known limits. It may still turn out to be inadmissible.
  [[nodiscard]] virtual ScaledParameters nearest_admissible(const ScaledParameters& point) const {
    return point;
  }
};

/// A target with first derivatives.
class DifferentiableTarget : public OptimizationTarget {
 public:
  /// The matrix is 0. nullopt when the point is inadmissible.
  virtual std::optional<TargetValue> evaluate_with_gradient(const ScaledParameters& point) = 0;
};

/// A target that also has a positive semi-definite approximation of its negative Hessian.
class LeastSquaresTarget : public DifferentiableTarget {
 public:
  virtual std::optional<TargetValue> evaluate_with_normal_equations(
      const ScaledParameters& point) = 0;
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
  int evaluations = 0;   ///< so far in this search
  ScaledParameters point = ScaledParameters::Zero();
};

struct OptimizerResult {
  ScaledParameters point = ScaledParameters::Zero();
  double value = 0.0;  ///< NaN when the start is inadmissible
  int evaluations = 0;
  int inadmissible = 0;  ///< how many of these points were inadmissible
  StopReason stop_reason = StopReason::StepBelowFinal;
  std::vector<OptimizerIteration> trace;
};

/// What one search may spend, and the key of its random numbers.
struct SearchBudget {
  int max_evaluations = 5000;    ///< calls of the target; derivatives do not count extra
  std::uint64_t random_key = 0;  ///< of (seed, case, start); only cma-es draws
};

/// A search from the origin of the scaled parameters. The type of its target says which derivatives
/// it needs. The same target, options and budget give the same result, which is overwritten and its
/// memory reused.
template <typename Target>
using Search = void (*)(Target& target,
                        const OptimizerOptions& options,
                        const SearchBudget& budget,
                        OptimizerResult& result);

struct Optimizer {
  const char* name;
  const char* help;
  std::variant<Search<OptimizationTarget>, Search<DifferentiableTarget>, Search<LeastSquaresTarget>>
      search;

  [[nodiscard]] Derivatives needs() const { return static_cast<Derivatives>(search.index()); }
  void maximize(LeastSquaresTarget& target,
                const OptimizerOptions& options,
                const SearchBudget& budget,
                OptimizerResult& result) const {
    std::visit([&](const auto run) { run(target, options, budget, result); }, search);
  }
};

/// Every optimiser.
std::span<const Optimizer> known_optimizers();
/// The optimiser of that name. Throws InputError that lists the known names.
const Optimizer& known_optimizer(const std::string& name);

/// Their names, and one line that explains them.
std::vector<std::string> optimizer_names();
std::string optimizer_help();

}  // namespace af::registration
