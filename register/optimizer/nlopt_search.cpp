// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/nlopt_search.h"

#include <algorithm>
#include <exception>
#include <memory>
#include <nlopt.h>

#include "base/error.h"
#include "register/optimizer/search_run.h"

namespace af::registration {
namespace {

struct OptimizerDeleter {
  void operator()(nlopt_opt optimizer) const { nlopt_destroy(optimizer); }
};
using OptimizerHandle = std::unique_ptr<nlopt_opt_s, OptimizerDeleter>;

/// The state of NLopt's callback. It keeps exceptions, which must not cross C code.
struct Callback {
  const OptimizationTarget& target;
  double initial_step_mm;
  SearchRun& run;
  nlopt_opt optimizer;
  double worst_value;
  bool met_limit = false;  ///< whether a point since the best one met it
  bool has_ended = false;
  std::exception_ptr failure;
};

double value_for_nlopt(unsigned /*count*/, const double* x, double* /*gradient*/, void* data) {
  auto& callback = *static_cast<Callback*>(data);
  try {
    const ScaledParameters wanted = Eigen::Map<const ScaledParameters>(x);
    // Beyond known limits, models see a smooth slope down from the value at the limit, not a cliff.
    const ScaledParameters point = callback.target.nearest_admissible(wanted);
    const SearchRun::Evaluation evaluation = callback.run.evaluate(point);
    if (evaluation.outcome == SearchRun::Outcome::Value) {
      const double value = evaluation.target.value;
      callback.worst_value = std::min(callback.worst_value, value);
      if (value > callback.run.result().value) {
        callback.run.accept(point, value);
        callback.run.trace(0.0);
        callback.met_limit = false;
      }
      const double steps_beyond = (wanted - point).norm() / callback.initial_step_mm;
      return value -
             (callback.run.result().value - callback.worst_value) * steps_beyond * steps_beyond;
    }
    if (evaluation.outcome == SearchRun::Outcome::Inadmissible) {
      callback.met_limit = true;
    } else {
      callback.has_ended = true;
      nlopt_force_stop(callback.optimizer);
    }
  } catch (...) {
    callback.failure = std::current_exception();
    nlopt_force_stop(callback.optimizer);
  }
  // The value is finite, so that BOBYQA's models stay defined, and less than any admissible value
  // so far.
  const double best = callback.run.result().value;
  return callback.worst_value - 0.1 * (best - callback.worst_value);
}

void require_success(nlopt_result code, const char* what) {
  check(code >= 0, what);
}

void nlopt_search(nlopt_algorithm algorithm,
                  OptimizationTarget& target,
                  const OptimizerOptions& options,
                  const SearchBudget& budget,
                  OptimizerResult& result) {
  SearchRun run(target, budget, result);
  if (!run.begin()) return;
  const OptimizerHandle optimizer(nlopt_create(algorithm, 6));
  check(optimizer != nullptr, "NLopt gives an optimiser");
  Callback callback{
      target, options.initial_step_mm, run, optimizer.get(), result.value, false, false, nullptr};
  require_success(nlopt_set_max_objective(optimizer.get(), value_for_nlopt, &callback),
                  "NLopt takes an objective");
  require_success(nlopt_set_initial_step1(optimizer.get(), options.initial_step_mm),
                  "NLopt takes a first step");
  require_success(nlopt_set_xtol_abs1(optimizer.get(), options.final_step_mm),
                  "NLopt takes a final step");
  ScaledParameters point = ScaledParameters::Zero();
  double value = 0.0;
  // NLopt's own result does not matter, only what the callback saw. BOBYQA also reports a failure
  // when rounding stopped its steps.
  nlopt_optimize(optimizer.get(), point.data(), &value);
  if (callback.failure) std::rethrow_exception(callback.failure);
  run.trace(options.final_step_mm);
  if (!callback.has_ended) run.converge(callback.met_limit, options.final_step_mm);
}

}  // namespace

void bobyqa(OptimizationTarget& target,
            const OptimizerOptions& options,
            const SearchBudget& budget,
            OptimizerResult& result) {
  nlopt_search(NLOPT_LN_BOBYQA, target, options, budget, result);
}

void nelder_mead(OptimizationTarget& target,
                 const OptimizerOptions& options,
                 const SearchBudget& budget,
                 OptimizerResult& result) {
  nlopt_search(NLOPT_LN_NELDERMEAD, target, options, budget, result);
}

}  // namespace af::registration
