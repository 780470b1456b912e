// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/optimizer.h"

#include <cmath>
#include <sstream>

#include "base/error.h"
#include "register/optimizer/best_neighbor_search.h"
#include "register/optimizer/cma_es.h"
#include "register/optimizer/gauss_newton.h"
#include "register/optimizer/gradient_ascent.h"
#include "register/optimizer/nlopt_search.h"

namespace af::registration {

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

std::vector<std::string> problems(const OptimizerOptions& options) {
  std::vector<std::string> found;
  const auto text = [](double value) {
    std::ostringstream out;
    out << value;
    return out.str();
  };
  if (!(options.final_step_mm > 0.0) || !std::isfinite(options.final_step_mm))
    found.push_back("final_step_mm = " + text(options.final_step_mm) + ": must be > 0");
  if (!(options.initial_step_mm >= options.final_step_mm) ||
      !std::isfinite(options.initial_step_mm))
    found.push_back("initial_step_mm = " + text(options.initial_step_mm) +
                    ": must be >= final_step_mm = " + text(options.final_step_mm));
  if (options.population < 4 || options.population > 100000)
    found.push_back("population = " + std::to_string(options.population) +
                    ": must be 4 ... 100000");
  return found;
}

void OptimizationTarget::evaluate_all(std::span<const ScaledParameters> points,
                                      std::span<std::optional<double>> values) {
  check(points.size() == values.size(), "one value per point");
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i]);
}

std::optional<TargetValue> OptimizationTarget::evaluate_with(const ScaledParameters& /*point*/,
                                                             Derivatives /*derivatives*/) {
  check(false, "this target has no derivatives");
  return std::nullopt;
}

std::vector<std::string> optimizer_names() {
  return {"best-neighbor", "gauss-newton", "gradient", "bobyqa", "nelder-mead", "cma-es"};
}

std::unique_ptr<Optimizer> make_optimizer(const std::string& name) {
  if (name == "best-neighbor") return std::make_unique<BestNeighborSearch>();
  if (name == "gauss-newton") return std::make_unique<GaussNewton>();
  if (name == "gradient") return std::make_unique<GradientAscent>();
  if (name == "bobyqa") return std::make_unique<NloptSearch>(NloptAlgorithm::Bobyqa);
  if (name == "nelder-mead") return std::make_unique<NloptSearch>(NloptAlgorithm::NelderMead);
  if (name == "cma-es") return std::make_unique<CmaEs>();
  std::string list;
  for (const std::string& known : optimizer_names()) list += (list.empty() ? "" : ", ") + known;
  throw InputError("optimizer", "'" + name + "'", "must be one of " + list);
}

}  // namespace af::registration
