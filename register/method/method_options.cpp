// SPDX-License-Identifier: Apache-2.0
#include "register/method/method_options.h"

#include "base/error.h"
#include "base/number_text.h"
#include "base/thread_pool.h"
#include "register/method/presets.h"

namespace af::registration {
namespace {

constexpr const char* kRegionOfTarget = "target";
constexpr const char* kRegionOfStudy = "study";

/// The chain of a finish or a judge, which cannot depend on other chains.
ChainOptions unconditional_chain(const std::string& name, const std::string& text) {
  ChainOptions chain = chain_from_text(name, text);
  if (chain.is_last_resort() || chain.from_best_end)
    throw InputError(
        name, "'" + text + "'", "only a chain can begin with 'below VALUE:' or 'again:'");
  return chain;
}

/// Replaces the preset's chains by those that were typed.
void replace_chains(const MethodOptions& options, RegistrationOptions& result) {
  if (!options.chains.empty()) {
    result.chains.clear();
    result.finish = {};
  }
  for (const std::string& text : options.chains)
    result.chains.push_back(
        chain_from_text("chain-" + std::to_string(result.chains.size() + 1), text));
  if (options.finish.has_value()) result.finish = unconditional_chain("finish", *options.finish);
  if (options.judge_least_value.has_value()) result.judge.least_value = *options.judge_least_value;
  if (options.judge_enough_value.has_value())
    result.judge.enough_value = *options.judge_enough_value;
  if (!options.judge.has_value()) return;
  const ChainOptions judge = unconditional_chain("judge", *options.judge);
  if (judge.stages.size() != 1)
    throw InputError("judge", "'" + *options.judge + "'", "must be one stage");
  result.judge.stage = judge.stages.front();
}

void describe_chains(Fields& field, MethodOptions& options) {
  const char* const why = "the chains in force hold it";
  field("preset",
        options.preset,
        "Method as a whole; the options below replace parts of it. " + preset_help() +
            ". Default: robust; paper with --similarity or --optimizer")
      .choice(preset_names());
  field("similarity", options.similarity, "Similarity measure of every stage. " + similarity_help())
      .choice(similarity_names())
      .not_recorded(why);
  field("optimizer", options.optimizer, "Optimiser of every stage. " + optimizer_help())
      .choice(optimizer_names())
      .not_recorded(why);
  field("chain",
        options.chains,
        "Stages in place of the preset's, separated by ';': measure, optimiser, and any of these "
        "keys with a number. " +
            chain_keys_help() +
            ". Given several times, a judge takes the best end; 'below VALUE:' before a chain runs "
            "it only below this worth, 'again:' from the best end");
  field("finish",
        options.finish,
        "Stages, written as for --chain, that refine the best ends of all chains (default: the "
        "preset's; none with --chain)");
  field("judge",
        options.judge,
        "For several chains: the stage, of measure rg, that compares their ends (default: the "
        "preset's)");
  field("judge_least_value", options.judge_least_value, "Ends below it are failures")
      .no_option("the preset's");
  field("judge_enough_value",
        options.judge_enough_value,
        "For several chains: stop at an end that explains this share of the X-rays' gradients; 1: "
        "run them all (default: the preset's, 0.6 of robust)")
      .within(0.0, 1.0);
  field("smoothing_sigma_mm",
        options.smoothing_sigma_mm,
        "First stage: Gaussian on the X-rays, mm on the isocentre plane (paper: 1)")
      .not_recorded(why);
}

}  // namespace

void MethodOptions::describe(Fields& field) {
  field.start_group("Method");
  describe_chains(field, *this);
  field("max_evaluations", max_evaluations, "Most poses tried per registration (default: 5000)");
  field("region",
        region,
        "Region where X-rays are compared: target: it follows the target box; study: it stays at "
        "the study's roi_px (default: target; study with --preset paper)")
      .choice({kRegionOfTarget, kRegionOfStudy});
  field("fiducial_mask_mm",
        fiducial_mask_mm,
        "Radius of discs about the study's fiducials that registration does not see, mm on the "
        "isocentre plane; 0: none")
      // Larger discs would hide what is to be registered.
      .within(0.0, 50.0);
  field("threads",
        threads,
        "Threads of one registration on every rank; 0: all its processors. Share many starts among "
        "ranks instead")
      .not_deciding("results do not depend on it");
  field.start_group("");
  field("seed", seed, "Seed of the random numbers that cma-es draws").no_option("programs add it");
}

std::string MethodOptions::preset_name() const {
  if (preset.has_value()) return *preset;
  return similarity.has_value() || optimizer.has_value() ? "paper" : "robust";
}

RegistrationOptions resolve(const MethodOptions& options) {
  RegistrationOptions result = preset_options(options.preset_name());
  replace_chains(options, result);
  if (options.similarity.has_value()) result.use_similarity(*options.similarity);
  if (options.optimizer.has_value()) result.use_optimizer(*options.optimizer);
  for (ChainOptions& chain : result.chains)
    if (options.smoothing_sigma_mm.has_value() && !chain.stages.empty())
      chain.stages.front().smoothing_sigma_mm = *options.smoothing_sigma_mm;
  if (options.max_evaluations.has_value()) result.max_evaluations = *options.max_evaluations;
  if (options.region.has_value()) {
    if (*options.region != kRegionOfTarget && *options.region != kRegionOfStudy)
      throw InputError("region",
                       "'" + *options.region + "'",
                       std::string("must be ") + kRegionOfTarget + " or " + kRegionOfStudy);
    result.region_follows_target = *options.region == kRegionOfTarget;
  }
  result.seed = options.seed;
  std::vector<std::string> found = problems(result);
  if (options.judge_enough_value.has_value() && result.chains.size() < 2)
    found.push_back("judge_enough_value = " + number_text(*options.judge_enough_value) +
                    ": must be left out where the method is one chain, which nothing judges");
  for (const std::string& text : thread_problems(options.threads)) found.push_back(text);
  for (const std::string& text : field_problems(options)) found.push_back(text);
  throw_if_any(found);
  return result;
}

MethodOptions MethodOptions::in_force() const {
  const RegistrationOptions resolved = resolve(*this);
  MethodOptions options;
  options.preset = preset_name();
  options.max_evaluations = resolved.max_evaluations;
  options.region = resolved.region_follows_target ? kRegionOfTarget : kRegionOfStudy;
  options.seed = seed;
  options.threads = threads;
  options.fiducial_mask_mm = fiducial_mask_mm;
  for (const ChainOptions& chain : resolved.chains) options.chains.push_back(chain_text(chain));
  if (!resolved.finish.stages.empty()) options.finish = chain_text(resolved.finish);
  if (resolved.chains.size() > 1) {
    options.judge = chain_text({"judge", {resolved.judge.stage}});
    options.judge_least_value = resolved.judge.least_value;
    options.judge_enough_value = resolved.judge.enough_value;
  }
  return options;
}

}  // namespace af::registration
