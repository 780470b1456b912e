// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// The curvature (negative Hessian) of a target at the origin, by central differences of its
/// derivatives over `step_mm` to both sides, or as far as the target's limits admit. Directions
/// that bend upwards or hardly at all get a small curvature. Curvatures above Gauss and Newton's
/// (of Derivatives::NormalEquations) are reduced to it, so that Newton's steps lead up. Evaluates
/// the target thirteen times.
ScaledMatrix measured_curvature(LeastSquaresTarget& target,
                                Derivatives derivatives,
                                double step_mm);

struct NewtonOptions {
  Derivatives derivatives = Derivatives::Gradient;
  double longest_step_mm = 2.0;
  /// The search stops after a step no longer than this, measured by `length_mm`.
  double tolerance_mm = 0.005;
  std::function<double(const ScaledParameters& from, const ScaledParameters& to)> length_mm;
};

/// Newton's steps for a target that is expensive to evaluate, from near its optimum and from its
/// `curvature` there, which may be that of a similar, cheaper target. Each evaluation corrects the
/// curvature along the previous step (symmetric rank one: Nocedal and Wright, Numerical
/// Optimization, 2006, Sec. 6.2). The last step is not evaluated, nor is a step for which no budget
/// is left. The result then has the value of the point before.
/// \test NewtonSearch.TakesFewEvaluationsWithACurvatureThatIsNearlyRight
void newton_search(LeastSquaresTarget& target,
                   ScaledMatrix curvature,
                   const NewtonOptions& options,
                   const SearchBudget& budget,
                   OptimizerResult& result);

}  // namespace af::registration
