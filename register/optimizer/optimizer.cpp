// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/optimizer.h"

#include <array>
#include <cmath>

#include "base/named_rows.h"
#include "base/number_text.h"
#include "register/optimizer/best_neighbor_search.h"
#include "register/optimizer/cma_es.h"
#include "register/optimizer/gauss_newton.h"
#include "register/optimizer/gradient_ascent.h"
#include "register/optimizer/nlopt_search.h"

namespace af::registration {
namespace {

/// Every optimiser. A new one is added here.
constexpr std::array kOptimizers = {
    Optimizer{"best-neighbor", "the paper's: best of 12 neighbours", best_neighbor_search},
    Optimizer{"gauss-newton", "steps from normal equations", gauss_newton},
    Optimizer{"quasi-newton", "gauss-newton that learns curvature", quasi_newton},
    Optimizer{"gradient", "steps along the gradient", gradient_ascent},
    Optimizer{"bobyqa", "quadratic models in a trust region", bobyqa},
    Optimizer{"nelder-mead", "simplex", nelder_mead},
    Optimizer{"cma-es", "random populations, for far starts", cma_es},
};

}  // namespace

const char* to_string(StopReason reason) {
  switch (reason) {
    case StopReason::StepBelowFinal:
      return "step-below-final";
    case StopReason::EvaluationBudgetSpent:
      return "evaluation-budget-spent";
    case StopReason::PinnedAtLimit:
      return "pinned-at-limit";
    case StopReason::StartInadmissible:
      return "start-inadmissible";
    case StopReason::CtOutsideRoi:
      return "ct-outside-roi";
    case StopReason::NonFiniteSimilarity:
      return "non-finite-similarity";
    case StopReason::NoBetterThanNoDrr:
      return "no-better-than-no-drr";
  }
  return "unknown";
}

std::array<ScaledParameters, 12> neighbors(const ScaledParameters& point, double step_mm) {
  std::array<ScaledParameters, 12> moved;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    moved[i] = point;
    moved[i][static_cast<Eigen::Index>(i / 2)] += i % 2 == 0 ? -step_mm : step_mm;
  }
  return moved;
}

void OptimizerOptions::describe(Fields& field) {
  field("initial_step_mm", initial_step_mm, "mm: first, and with derivatives longest, step")
      .as("step")
      .such_that(">= final_step_mm = " + number_text(final_step_mm),
                 [least = final_step_mm](double v) { return v >= least && std::isfinite(v); });
  field("final_step_mm", final_step_mm, "mm: steps below it end the search")
      .as("final")
      .above(0.0)
      .finite();
  field("population", population, "cma-es: points per generation").within(4, 99999);
}

void OptimizationTarget::evaluate_all(std::span<const ScaledParameters> points,
                                      std::span<std::optional<double>> values) {
  check(points.size() == values.size(), "one value per point");
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i]);
}

std::span<const Optimizer> known_optimizers() {
  return kOptimizers;
}

const Optimizer& known_optimizer(const std::string& name) {
  return required_row(kOptimizers, "optimizer", name);
}

std::vector<std::string> optimizer_names() {
  return names_of(kOptimizers);
}

std::string optimizer_help() {
  return help_of(kOptimizers);
}

}  // namespace af::registration
