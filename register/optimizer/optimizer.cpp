// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/optimizer.h"

#include <cmath>
#include <sstream>

#include "base/error.h"
#include "register/optimizer/best_neighbor_search.h"

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
  return found;
}

std::vector<std::string> optimizer_names() {
  return {"best-neighbor"};
}

std::unique_ptr<Optimizer> make_optimizer(const std::string& name) {
  if (name == "best-neighbor") return std::make_unique<BestNeighborSearch>();
  std::string list;
  for (const std::string& known : optimizer_names()) list += (list.empty() ? "" : ", ") + known;
  throw InputError("optimizer", "'" + name + "'", "must be one of " + list);
}

}  // namespace af::registration
