// SPDX-License-Identifier: Apache-2.0
#include "register/method/method_options.h"

#include <sstream>

#include "base/error.h"
#include "base/thread_pool.h"
#include "register/method/chain_text.h"
#include "register/method/presets.h"

namespace af::registration {
namespace {

/// Larger discs would hide the anatomy that is to be registered.
constexpr double kMostFiducialMaskMm = 50.0;

void replace_in_chain(const MethodOptions& options, ChainOptions& chain) {
  for (StageOptions& stage : chain.stages) {
    if (options.bins.has_value()) stage.similarity.bins = *options.bins;
    if (options.coarse_roi_scale.has_value() && stage.roi_scale > 1.0)
      stage.roi_scale = *options.coarse_roi_scale;
  }
}

void replace_in_stages(const MethodOptions& options, RegistrationOptions& result) {
  if (options.similarity.has_value()) result.use_similarity(*options.similarity);
  if (options.optimizer.has_value()) result.use_optimizer(*options.optimizer);
  for (ChainOptions& chain : result.chains) {
    if (options.smoothing_sigma_mm.has_value() && !chain.stages.empty())
      chain.stages.front().smoothing_sigma_mm = *options.smoothing_sigma_mm;
    replace_in_chain(options, chain);
  }
  replace_in_chain(options, result.finish);
}

/// The chains that were typed, in place of the preset's.
void replace_chains(const MethodOptions& options, RegistrationOptions& result) {
  if (!options.chains.empty()) {
    result.chains.clear();
    result.finish = {};
  }
  for (const std::string& text : options.chains)
    result.chains.push_back(
        chain_from_text("chain-" + std::to_string(result.chains.size() + 1), text));
  if (options.finish.has_value()) result.finish = chain_from_text("finish", *options.finish);
  if (!options.judge.has_value()) return;
  const ChainOptions judge = chain_from_text("judge", *options.judge);
  if (judge.stages.size() != 1)
    throw InputError("judge", "'" + *options.judge + "'", "must be one stage");
  result.judge.stage = judge.stages.front();
}

}  // namespace

std::string MethodOptions::preset_name() const {
  if (preset.has_value()) return *preset;
  return similarity.has_value() || optimizer.has_value() ? "paper" : "robust";
}

RegistrationOptions resolve(const MethodOptions& options) {
  RegistrationOptions result = preset_options(options.preset_name());
  replace_chains(options, result);
  replace_in_stages(options, result);
  if (options.max_evaluations.has_value()) result.max_evaluations = *options.max_evaluations;
  result.seed = options.seed;
  std::vector<std::string> found = problems(result);
  for (const std::string& text : thread_problems(options.threads)) found.push_back(text);
  if (!(options.fiducial_mask_mm >= 0.0 && options.fiducial_mask_mm <= kMostFiducialMaskMm)) {
    found.push_back("--fiducial-mask-mm = " + shortest_text(options.fiducial_mask_mm) +
                    ": must be within 0 and " + shortest_text(kMostFiducialMaskMm));
  }
  throw_if_any(found);
  return result;
}

std::string to_toml(const MethodOptions& options, const RegistrationOptions& resolved) {
  std::ostringstream out;
  out << "preset = \"" << options.preset_name()
      << "\"\nmax_evaluations = " << resolved.max_evaluations << "\nseed = " << resolved.seed
      << "\nthreads = " << options.threads
      << "\nfiducial_mask_mm = " << shortest_text(options.fiducial_mask_mm) << "\nchain = [";
  for (const ChainOptions& chain : resolved.chains) out << "\n  \"" << chain_text(chain) << "\",";
  out << "\n]\n";
  if (!resolved.finish.stages.empty())
    out << "finish = \"" << chain_text(resolved.finish) << "\"\n";
  if (resolved.chains.size() > 1)
    out << "judge = \"" << stage_text(resolved.judge.stage)
        << "\"\njudge_least_value = " << shortest_text(resolved.judge.least_value)
        << "\njudge_enough_value = " << shortest_text(resolved.judge.enough_value) << '\n';
  return out.str();
}

}  // namespace af::registration
