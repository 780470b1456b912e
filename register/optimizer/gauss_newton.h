// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// Levenberg and Marquardt on the normal equations of a sum of squares (Madsen, Nielsen, Tingleff,
/// Methods for Non-Linear Least Squares Problems, 2004, Sec. 3.2). The step solves (H + lambda diag
/// H) h = g and is no longer than initial_step_mm. A better point lowers lambda. After a worse or
/// inadmissible one, the step is tried again without what was learned. Then lambda rises until the
/// step, before limits trim it, is at most half as long, which also turns it. The search ends when
/// a step falls below final_step_mm. \test GaussNewton.EndsAQuadraticInAFewSteps,
/// GaussNewton.HalvesRejectedStepsAtLeast, QuasiNewton.LearnsMissingCurvature
void gauss_newton(LeastSquaresTarget& target,
                  const OptimizerOptions& options,
                  const SearchBudget& budget,
                  OptimizerResult& result);

/// The same with the curvature that normal equations leave out, learned from accepted steps
/// (Dennis, Gay and Welsch, ACM TOMS 7(3), 1981).
void quasi_newton(LeastSquaresTarget& target,
                  const OptimizerOptions& options,
                  const SearchBudget& budget,
                  OptimizerResult& result);

}  // namespace af::registration
