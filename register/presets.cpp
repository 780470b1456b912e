// SPDX-License-Identifier: Apache-2.0
#include "register/presets.h"

#include <array>

#include "base/error.h"

namespace af::registration {
namespace {

StageOptions gauss_newton_stage(const char* similarity,
                                int level,
                                int pixel_step,
                                double roi_scale,
                                double longest_step_mm,
                                double final_step_mm) {
  StageOptions stage;
  stage.level = level;
  stage.pixel_step = pixel_step;
  stage.roi_scale = roi_scale;
  stage.similarity.name = similarity;
  stage.optimizer = "gauss-newton";
  stage.search.initial_step_mm = longest_step_mm;
  stage.search.final_step_mm = final_step_mm;
  return stage;
}

RegistrationOptions one_chain(ChainOptions chain) {
  RegistrationOptions options;
  options.chains = {std::move(chain)};
  options.judge.stage.level = 1;
  options.judge.stage.pixel_step = 2;
  return options;
}

RegistrationOptions paper_preset() {
  return one_chain(paper_chain());
}

RegistrationOptions fast_preset() {
  return one_chain({"fast",
                    {gauss_newton_stage("ncc", 2, 8, 2.0, 10.0, 0.5),
                     gauss_newton_stage("gc", 2, 8, 2.0, 5.0, 0.2),
                     gauss_newton_stage("gc", 2, 4, 1.0, 5.0, 0.1),
                     gauss_newton_stage("gc", 1, 2, 1.0, 2.0, 0.02)}});
}

RegistrationOptions robust_preset() {
  return one_chain({"robust",
                    {gauss_newton_stage("ncc", 2, 8, 2.0, 10.0, 0.5),
                     gauss_newton_stage("tncc", 2, 8, 2.0, 5.0, 0.2),
                     gauss_newton_stage("rg", 2, 4, 1.0, 5.0, 0.1),
                     gauss_newton_stage("rg", 1, 2, 1.0, 2.0, 0.05),
                     gauss_newton_stage("rg", 0, 2, 1.0, 2.0, 0.02)}});
}

struct Preset {
  const char* name;
  const char* help;
  RegistrationOptions (*make)();
};

constexpr std::array kPresets = {
    Preset{"paper", "mutual information with best neighbour in two passes", paper_preset},
    Preset{"fast", "Gauss-Newton on correlations, coarse to fine", fast_preset},
    Preset{"robust", "Gauss-Newton on tiles, then on robust gradient residuals", robust_preset},
};

}  // namespace

ChainOptions paper_chain() {
  StageOptions smoothed;
  smoothed.smoothing_sigma_mm = 1.0;
  smoothed.search.initial_step_mm = 5.0;
  smoothed.search.final_step_mm = 0.5;
  StageOptions sharp;
  sharp.search.initial_step_mm = 2.0;
  sharp.search.final_step_mm = 0.1;
  return {"paper", {smoothed, sharp}};
}

std::vector<std::string> preset_names() {
  std::vector<std::string> names;
  for (const Preset& preset : kPresets) names.emplace_back(preset.name);
  return names;
}

std::string preset_help() {
  std::string text;
  for (const Preset& preset : kPresets)
    text += (text.empty() ? "" : "; ") + std::string(preset.name) + ": " + preset.help;
  return text;
}

RegistrationOptions preset_options(const std::string& name) {
  for (const Preset& preset : kPresets)
    if (name == preset.name) return preset.make();
  std::string list;
  for (const std::string& known : preset_names()) list += (list.empty() ? "" : ", ") + known;
  throw InputError("preset", "'" + name + "'", "must be one of " + list);
}

}  // namespace af::registration
