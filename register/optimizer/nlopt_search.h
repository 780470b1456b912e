// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// Searches of NLopt that need no derivatives.
enum class NloptAlgorithm {
  Bobyqa,      ///< quadratic models in a trust region (Powell, report DAMTP 2009/NA06)
  NelderMead,  ///< simplex (Nelder and Mead, Computer Journal 7, 1965; Box, 1965)
};

/// NLopt's BOBYQA or Nelder-Mead: the first step is initial_step_mm along every parameter, and the
/// search has converged when its points are within final_step_mm of each other. To them, an
/// inadmissible point is somewhat worse than the worst admissible one. \test
/// NloptSearch.FindsAQuadraticsMaximum
class NloptSearch final : public Optimizer {
 public:
  explicit NloptSearch(NloptAlgorithm algorithm) : algorithm_(algorithm) {}

  void maximize(OptimizationTarget& target,
                const OptimizerOptions& options,
                const SearchBudget& budget,
                OptimizerResult& result) const override;

 private:
  NloptAlgorithm algorithm_;
};

}  // namespace af::registration
