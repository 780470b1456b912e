// SPDX-License-Identifier: Apache-2.0
#include "register/method/method_options.h"

#include <limits>

#include <gtest/gtest.h>

#include "base/error.h"
#include "files/options_toml.h"
#include "register/method/presets.h"
#include "register/verdict/verdict.h"

namespace af::registration {
namespace {

TEST(MethodOptions, ReplaceWhatThePresetSays) {
  MethodOptions options;
  options.similarity = "ncc";
  options.smoothing_sigma_mm = 2.5;
  options.max_evaluations = 77;
  options.seed = 9;
  const RegistrationOptions method = resolve(options);
  ASSERT_EQ(method.chains.size(), 1U);
  const std::vector<StageOptions>& stages = method.chains[0].stages;
  EXPECT_EQ(stages[0].similarity.name, "ncc");
  EXPECT_EQ(stages[1].similarity.name, "ncc");
  EXPECT_EQ(stages[0].smoothing_sigma_mm, 2.5);
  EXPECT_EQ(stages[1].smoothing_sigma_mm, 0.0);
  EXPECT_EQ(stages[0].optimizer, "best-neighbor");
  EXPECT_EQ(method.max_evaluations, 77);
  EXPECT_EQ(method.seed, 9U);
  options.max_evaluations = 0;
  EXPECT_THROW(resolve(options), InputError);
}

TEST(MethodOptions, TakeTheRobustPresetUnlessAMeasureOrAnOptimizerIsChosen) {
  MethodOptions options;
  EXPECT_EQ(options.preset_name(), "robust");
  EXPECT_EQ(resolve(options).chains.size(), preset_options("robust").chains.size());
  options.similarity = "mi";
  EXPECT_EQ(options.preset_name(), "paper");
  options.similarity.reset();
  options.optimizer = "bobyqa";
  EXPECT_EQ(options.preset_name(), "paper");
  options.preset = "fast";
  EXPECT_EQ(options.preset_name(), "fast");
}

TEST(MethodOptions, RegionsFollowTheTargetExceptInThePapersMethod) {
  MethodOptions options;
  EXPECT_TRUE(resolve(options).region_follows_target);
  EXPECT_EQ(options.in_force().region, "target");
  options.preset = "paper";
  EXPECT_FALSE(resolve(options).region_follows_target);
  EXPECT_EQ(options.in_force().region, "study");
  options.region = "target";
  EXPECT_TRUE(resolve(options).region_follows_target);
  options.region = "detector";
  EXPECT_THROW(resolve(options), InputError);
}

TEST(MethodOptions, ChainsLeaveThePresetsFinishBehindUnlessOneIsTyped) {
  MethodOptions options;
  options.preset = "robust";
  options.judge = "rg gauss-newton level=1 pixels=3";
  EXPECT_FALSE(resolve(options).finish.stages.empty());
  options.chains = {"ncc gauss-newton", "gc gauss-newton"};
  EXPECT_TRUE(resolve(options).finish.stages.empty());
  options.finish = "ssd gauss-newton; rg gauss-newton";
  const RegistrationOptions method = resolve(options);
  ASSERT_EQ(method.finish.stages.size(), 2U);
  EXPECT_EQ(method.similarity_list(), "ncc, gc, ssd, rg");
  EXPECT_EQ(method.judge.stage.pixel_step, 3);
  const std::string text = to_toml(options);
  EXPECT_NE(text.find("finish = \"" + *options.finish + "\""), std::string::npos) << text;
  options.judge = "mi best-neighbor";
  EXPECT_THROW(resolve(options), InputError);
  options.judge = "rg gauss-newton; rg gauss-newton";
  EXPECT_THROW(resolve(options), InputError);
}

TEST(MethodOptions, SayWhichEndIsEnoughForAPortfolio) {
  MethodOptions options;
  EXPECT_EQ(resolve(options).judge.enough_value, preset_options("robust").judge.enough_value);
  options.judge_enough_value = 0.25;
  EXPECT_EQ(resolve(options).judge.enough_value, 0.25);
  EXPECT_EQ(options.in_force().judge_enough_value, 0.25);
  for (const double outside : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    options.judge_enough_value = outside;
    EXPECT_THROW(resolve(options), InputError) << outside;
  }
  options.judge_enough_value = 0.25;
  options.preset = "fast";
  EXPECT_THROW(resolve(options), InputError) << "one chain has no judge";
}

TEST(MethodOptions, InForceAreTheSameMethodAgain) {
  for (const std::string& preset : preset_names()) {
    MethodOptions options;
    options.preset = preset;
    options.similarity = "ncc";
    options.max_evaluations = 77;
    const std::string text = to_toml(options);
    EXPECT_EQ(to_toml(options.in_force()), text);
    EXPECT_EQ(text.find("\nsimilarity"), std::string::npos) << text;
  }
}

TEST(MethodOptions, ThatDifferInAnyDigitHaveOtherTexts) {
  MethodOptions options;
  options.fiducial_mask_mm = 4.0000001;
  const std::string one = to_toml(options);
  options.fiducial_mask_mm = 4.0000002;
  EXPECT_NE(to_toml(options), one);
  EXPECT_NE(one.find("fiducial_mask_mm = 4.0000001\n"), std::string::npos) << one;
}

TEST(MethodOptions, RefuseAnUnknownPreset) {
  MethodOptions options;
  options.preset = "unheard-of";
  EXPECT_THROW(resolve(options), InputError);
}

TEST(MethodOptions, RefuseAFiducialMaskOfNoSize) {
  for (const double radius_mm : {-1.0, 51.0, std::numeric_limits<double>::quiet_NaN()}) {
    MethodOptions options;
    options.fiducial_mask_mm = radius_mm;
    EXPECT_THROW(resolve(options), InputError) << radius_mm;
  }
}

TEST(MethodOptions, ChainsTakeThePlaceOfThePresets) {
  MethodOptions options;
  options.preset = "fast";
  options.chains = {"ssd cma-es population=9 step=7", "mi bobyqa; ncc gradient level=1 pixels=2"};
  const RegistrationOptions method = resolve(options);
  ASSERT_EQ(method.chains.size(), 2U);
  EXPECT_EQ(method.chains[0].stages[0].search.population, 9);
  EXPECT_EQ(method.chains[0].stages[0].search.initial_step_mm, 7.0);
  EXPECT_EQ(method.chains[1].stages[1].level, 1);
}

TEST(Presets, TheLastResortRunsBelowWhatIsWellExplained) {
  const RegistrationOptions robust = preset_options("robust");
  int last_resorts = 0;
  int again = 0;
  for (const ChainOptions& chain : robust.chains) {
    again += chain.from_best_end ? 1 : 0;
    if (!chain.is_last_resort()) continue;
    ++last_resorts;
    EXPECT_EQ(chain.only_below, kWellExplained.coarse);
    EXPECT_EQ(again, 0) << "searches about the best end come after all that may find a better one";
  }
  EXPECT_EQ(last_resorts, 1);
  EXPECT_GT(again, 0);
}

TEST(Presets, RobustSearchesCorrelationsOfGradientsWidelyAtTwoLevels) {
  std::vector<int> levels;
  for (const ChainOptions& chain : preset_options("robust").chains) {
    const StageOptions& search = chain.stages.front();
    if (!chain.from_best_end && search.optimizer == "cma-es" && search.similarity.name == "gc")
      levels.push_back(search.level);
  }
  EXPECT_EQ(levels, (std::vector<int>{3, 2}));
}

TEST(MethodOptions, ALastResortNeedsAChainBeforeIt) {
  MethodOptions options;
  options.chains = {"below 0.2: mi bobyqa", "ncc gradient"};
  EXPECT_THROW((void)resolve(options), InputError);
  options.chains = {"ncc gradient", "below 0.2: mi bobyqa"};
  EXPECT_EQ(resolve(options).chains.back().only_below, 0.2);
  MethodOptions finish = options;
  finish.finish = "below 0.2: rg gauss-newton";
  EXPECT_THROW((void)resolve(finish), InputError);
  MethodOptions judge = options;
  judge.judge = "below 0.2: rg best-neighbor";
  EXPECT_THROW((void)resolve(judge), InputError);
}

TEST(MethodOptions, AChainFromTheBestEndNeedsAChainBeforeIt) {
  MethodOptions options;
  options.chains = {"again: mi bobyqa", "ncc gradient"};
  EXPECT_THROW((void)resolve(options), InputError);
  options.chains = {"ncc gradient", "below 0.3: again: mi bobyqa", "again:mi bobyqa"};
  const std::vector<ChainOptions> chains = resolve(options).chains;
  EXPECT_FALSE(chains[0].from_best_end);
  EXPECT_TRUE(chains[1].from_best_end);
  EXPECT_EQ(chains[1].only_below, 0.3);
  EXPECT_TRUE(chains[2].from_best_end);
  EXPECT_FALSE(chains[2].is_last_resort());
  MethodOptions finish = options;
  finish.finish = "again: rg gauss-newton";
  EXPECT_THROW((void)resolve(finish), InputError);
}

TEST(ChainText, ReadsWhatItWrites) {
  for (const std::string& name : preset_names())
    for (const ChainOptions& chain : preset_options(name).chains) {
      const std::string text = chain_text(chain);
      const ChainOptions read = chain_from_text(chain.name, text);
      EXPECT_EQ(chain_text(read), text);
      EXPECT_EQ(read.stages.size(), chain.stages.size());
      EXPECT_EQ(read.only_below, chain.only_below);
      EXPECT_EQ(read.from_best_end, chain.from_best_end);
    }
}

TEST(ChainText, RefusesWhatItDoesNotKnow) {
  for (const char* text : {"",
                           "mi",
                           "mi bobyqa levle=1",
                           "mi bobyqa level=x",
                           "mi bobyqa level",
                           "mi bobyqa;;",
                           "below 0.2",
                           "below 0.2:",
                           "below 0.2 mi bobyqa",
                           "below x: mi bobyqa",
                           "below nan: mi bobyqa",
                           "below : mi bobyqa",
                           "again:",
                           "again mi bobyqa",
                           "again: below 0.2: mi bobyqa"})
    EXPECT_THROW(
        {
          const ChainOptions chain = chain_from_text("c", text);
          if (chain.stages.empty()) throw InputError("no stage");
        },
        InputError)
        << text;
}

}  // namespace
}  // namespace af::registration
