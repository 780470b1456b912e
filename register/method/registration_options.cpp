// SPDX-License-Identifier: Apache-2.0
#include "register/method/registration_options.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "register/method/presets.h"

namespace af::registration {
namespace {

std::string list_of(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

void add_once(const std::string& name, std::vector<std::string>& names) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

/// Whether the optimiser exists and its measure gives it the derivatives that it needs.
void append_optimizer_problems(const StageOptions& stage, std::vector<std::string>& found) {
  const std::vector<std::string> names = optimizer_names();
  if (std::find(names.begin(), names.end(), stage.optimizer) == names.end()) {
    found.push_back("optimizer = '" + stage.optimizer + "': must be one of " + list_of(names));
    return;
  }
  const Derivatives needs = make_optimizer(stage.optimizer)->needs();
  const bool is_served =
      needs == Derivatives::None ||
      (needs == Derivatives::Gradient ? similarity_has_derivative(stage.similarity.name)
                                      : similarity_has_normal_equations(stage.similarity.name));
  if (is_served) return;
  std::vector<std::string> fitting;
  for (const std::string& name : similarity_names())
    if (needs == Derivatives::Gradient ? similarity_has_derivative(name)
                                       : similarity_has_normal_equations(name))
      fitting.push_back(name);
  found.push_back("similarity = '" + stage.similarity.name + "': optimizer '" + stage.optimizer +
                  "' needs derivatives, which these have: " + list_of(fitting));
}

void append_chain_problems(const ChainOptions& chain, std::vector<std::string>& found) {
  for (std::size_t i = 0; i < chain.stages.size(); ++i)
    for (const std::string& text : problems(chain.stages[i]))
      found.push_back("chain '" + chain.name + "', stage " + std::to_string(i + 1) + ": " + text);
}

bool is_non_negative(double value) {
  return value >= 0.0 && std::isfinite(value);
}

}  // namespace

std::vector<std::string> problems(const StageOptions& stage) {
  std::vector<std::string> found = problems(stage.similarity);
  if (found.empty()) append_optimizer_problems(stage, found);
  for (const std::string& text : problems(stage.search)) found.push_back(text);
  if (stage.level < 0 || stage.level > kCoarsestLevel)
    found.push_back("level = " + std::to_string(stage.level) + ": must be 0 ... " +
                    std::to_string(kCoarsestLevel));
  if (stage.pixel_step < 1 || stage.pixel_step > 64)
    found.push_back("pixel_step = " + std::to_string(stage.pixel_step) + ": must be 1 ... 64");
  if (!(stage.roi_scale >= 0.1 && stage.roi_scale <= 4.0))
    found.push_back("roi_scale = " + std::to_string(stage.roi_scale) + ": must be 0.1 ... 4");
  if (!is_non_negative(stage.smoothing_sigma_mm))
    found.push_back("smoothing_sigma_mm = " + std::to_string(stage.smoothing_sigma_mm) +
                    ": must be >= 0");
  return found;
}

RegistrationOptions::RegistrationOptions() : chains{paper_chain()} {
  judge.stage.similarity.name = "rg";
  judge.stage.level = 2;
  judge.stage.pixel_step = 4;
  judge.stage.roi_scale = 2.0;
}

std::vector<StageOptions*> RegistrationOptions::stages() {
  std::vector<StageOptions*> all;
  for (ChainOptions& chain : chains)
    for (StageOptions& stage : chain.stages) all.push_back(&stage);
  for (StageOptions& stage : finish.stages) all.push_back(&stage);
  return all;
}

std::vector<const StageOptions*> RegistrationOptions::stages() const {
  std::vector<const StageOptions*> all;
  for (const ChainOptions& chain : chains)
    for (const StageOptions& stage : chain.stages) all.push_back(&stage);
  for (const StageOptions& stage : finish.stages) all.push_back(&stage);
  return all;
}

void RegistrationOptions::use_similarity(const std::string& name) {
  for (StageOptions* const stage : stages()) stage->similarity.name = name;
}

void RegistrationOptions::use_optimizer(const std::string& name) {
  for (StageOptions* const stage : stages()) stage->optimizer = name;
}

std::string RegistrationOptions::similarity_list() const {
  std::vector<std::string> names;
  for (const StageOptions* const stage : stages()) add_once(stage->similarity.name, names);
  return list_of(names);
}

std::string RegistrationOptions::optimizer_list() const {
  std::vector<std::string> names;
  for (const StageOptions* const stage : stages()) add_once(stage->optimizer, names);
  return list_of(names);
}

std::string RegistrationOptions::final_similarity() const {
  return chains.size() > 1 ? judge.stage.similarity.name : stages().back()->similarity.name;
}

int RegistrationOptions::coarsest_level() const {
  int coarsest = chains.size() > 1 ? judge.stage.level : 0;
  for (const StageOptions* const stage : stages()) coarsest = std::max(coarsest, stage->level);
  return coarsest;
}

std::vector<int> RegistrationOptions::last_levels() const {
  std::set<int> levels;
  if (!finish.stages.empty()) {
    levels.insert(finish.stages.back().level);
  } else {
    for (const ChainOptions& chain : chains)
      if (!chain.stages.empty()) levels.insert(chain.stages.back().level);
  }
  return {levels.begin(), levels.end()};
}

std::vector<std::string> problems(const RegistrationOptions& options) {
  std::vector<std::string> found;
  if (options.chains.empty()) found.emplace_back("chains = none: there must be at least one");
  for (const ChainOptions& chain : options.chains) {
    if (chain.stages.empty())
      found.push_back("chain '" + chain.name + "': stages = none: there must be at least one");
    append_chain_problems(chain, found);
  }
  append_chain_problems(options.finish, found);
  if (options.chains.size() > 1) {
    for (const std::string& text : problems(options.judge.stage)) found.push_back("judge: " + text);
    if (options.judge.stage.similarity.name != "rg")
      found.push_back("judge: similarity = '" + options.judge.stage.similarity.name +
                      "': must be rg, the measure whose value is 0 without any DRR");
  }
  if (options.max_evaluations < 1)
    found.push_back("max_evaluations = " + std::to_string(options.max_evaluations) +
                    ": must be >= 1");
  return found;
}

}  // namespace af::registration
