// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/precompute_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "files/options_toml.h"
#include "precompute/build/orbit_text.h"
#include "precompute/design/design_presets.h"

namespace af {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

TEST(PrecomputeOptions, TrainsOn64TilesPerCodewordUnlessAShareIsStated) {
  PrecomputeOptions options;
  options.codewords = 1000;
  EXPECT_EQ(options.training_selection().max_training_tiles, 64000u);
  EXPECT_EQ(options.training_selection().fraction, kLargestTrainingFraction);
  options.training_fraction = 0.1;
  EXPECT_EQ(options.training_selection().max_training_tiles, 2000000u);
  EXPECT_EQ(options.training_selection().fraction, 0.1);
}

TEST(PrecomputeOptions, TrainOnNoMoreTilesThanTheCap) {
  PrecomputeOptions options;
  options.codewords = 65536;
  EXPECT_EQ(options.training_selection().max_training_tiles, kTrainingTilesUnlessStated);
  options.max_training_tiles = 5;
  EXPECT_EQ(options.training_selection().max_training_tiles, 5u);
}

TEST(PrecomputeOptions, FieldsRecordWhichRuleChoseTheTrainingTiles) {
  PrecomputeOptions options;
  EXPECT_NE(to_toml(options).find("training_tiles_per_codeword = 32"), std::string::npos);
  options.preset = "paper";
  EXPECT_NE(to_toml(options).find("training_tiles_per_codeword = 64"), std::string::npos);
  options.training_fraction = 0.25;
  EXPECT_NE(to_toml(options).find("training_fraction = 0.25"), std::string::npos);
  EXPECT_EQ(to_toml(options).find("per_codeword"), std::string::npos);
}

TEST(PrecomputeOptions, DecideTheSamplesOrWhatTheCodebookMakesOfThem) {
  PrecomputeOptions options;
  options.preset = "paper";
  EXPECT_EQ(deciding_options(options, kCastingStage),
            (OptionTexts{{"material", "\"all\""},
                         {"max_rotation_deg", "10.0"},
                         {"max_translation_mm", "100.0"},
                         {"slabs", "1"},
                         {"st_plane", "\"centre\""},
                         {"uv_nodes", "64"},
                         {"st_nodes", "256"},
                         {"caster", "\"shear-warp\""},
                         {"step_mm", "1.0"},
                         {"water_mu_per_mm", "0.02"}}));
  EXPECT_EQ(deciding_options(options, kCodebookStage),
            (OptionTexts{{"codewords", "16384"},
                         {"training_tiles_per_codeword", "64"},
                         {"max_training_tiles", "2000000"},
                         {"seed", "1"}}));
}

TEST(PrecomputeOptions, TrainLongerForOneSlab) {
  PrecomputeOptions options;
  options.preset = "paper";
  EXPECT_EQ(options.in_force().codebook_options().min_relative_improvement, 0.005);
  options.preset = "standard";
  EXPECT_EQ(options.in_force().codebook_options().min_relative_improvement, 0.015);
}

TEST(FieldDesignOfOptions, IsThePapersByName) {
  PrecomputeOptions options;
  options.preset = "paper";
  EXPECT_EQ(options.design(), (FieldDesign{1, 64, 256, 16384, "linear"}));
  EXPECT_FALSE(options.needs_probe());
  EXPECT_FALSE(options.in_force().look_up.has_value());
}

TEST(FieldDesignOfOptions, IsThePapersWithThePartsThatAreStated) {
  PrecomputeOptions options;
  options.uv_nodes = 32;
  options.look_up = "cubic";
  EXPECT_EQ(options.design(), (FieldDesign{1, 32, 256, 16384, "cubic"}));
  EXPECT_FALSE(options.needs_probe());
  EXPECT_EQ(option_texts(to_toml(options)).at("uv_nodes"), "32");
  EXPECT_EQ(option_texts(to_toml(options)).at("st_nodes"), "256");
  EXPECT_EQ(option_texts(to_toml(options)).at("look_up"), "\"cubic\"");
}

TEST(FieldDesignOfOptions, IsProbedForWithinABudgetUnlessAllIsStated) {
  PrecomputeOptions options;
  options.budget.max_field_bytes = 8000000;
  EXPECT_TRUE(options.needs_probe());
  options.slabs = 4;
  EXPECT_TRUE(options.needs_probe());
  EXPECT_EQ(options.stated_parts().slabs, 4);
  EXPECT_FALSE(options.stated_parts().uv_nodes.has_value());
  EXPECT_FALSE(options.with_design({4, 16, 384, 16384, "cubic"}).needs_probe());
}

TEST(FieldDesignOfOptions, ASpacingStandsForNodesThatAreNotKnownYet) {
  PrecomputeOptions options;
  options.st_spacing_mm = 0.5;
  EXPECT_EQ(options.design(), (FieldDesign{1, 64, 256, 16384, "linear"}))
      << "it states a part of the design";
  const PrecomputeOptions known = options.in_force().with_st_nodes(1632);
  EXPECT_EQ(known.design().st_nodes, 1632);
  EXPECT_EQ(option_texts(to_toml(known)).count("st_spacing_mm"), 0U);
  PrecomputeOptions counted;
  counted.st_nodes = 1632;
  EXPECT_EQ(deciding_options(known, kCastingStage), deciding_options(counted, kCastingStage));
  options.preset = "fine";
  EXPECT_THAT(problems(options), Contains(HasSubstr("st_spacing_mm: a probe chooses the nodes")));
  options.slabs = 8;
  options.uv_nodes = 8;
  options.codewords = 65536;
  EXPECT_FALSE(options.needs_probe()) << "nothing is left to choose";
  EXPECT_TRUE(problems(options).empty());
}

TEST(FieldDesignOfOptions, ABudgetDecidesNothingButTheDesign) {
  const FieldDesign design{4, 16, 384, 16384, "cubic"};
  PrecomputeOptions options;
  PrecomputeOptions probed;
  probed.budget.target_psnr_db = 50.0;
  EXPECT_EQ(deciding_options(options.with_design(design)),
            deciding_options(probed.with_design(design)));
}

TEST(FieldDesignOfOptions, IsTheStandardOneWithoutAProbeWhenNothingIsSaid) {
  EXPECT_FALSE(PrecomputeOptions{}.needs_probe());
  EXPECT_EQ(std::string(PrecomputeOptions{}.design_preset().name), "standard");
}

TEST(FieldDesignOfOptions, EveryPresetIsSound) {
  for (const std::string& name : design_preset_names()) {
    PrecomputeOptions options;
    options.preset = name;
    EXPECT_TRUE(problems(options).empty()) << name;
  }
}

TEST(PrecomputeOptions, RangesOfAxesAreStatedOneByOne) {
  PrecomputeOptions options;
  options.max_rotation_deg = 7.0;
  options.max_translation_mm = 20.0;
  EXPECT_TRUE(options.range().is_symmetric());
  options.rotation_range_deg = "rx=-15:15,rz=-30:+12.5";
  options.translation_range_mm = "ty=40";
  const MotionRange range = options.range();
  const std::array<double, 6> low = {-15, -7, -30, -20, -40, -20};
  const std::array<double, 6> high = {15, 7, 12.5, 20, 40, 20};
  for (std::size_t i = 0; i < low.size(); ++i) {
    EXPECT_DOUBLE_EQ(range.low.deg_and_mm()[i], low[i]);
    EXPECT_DOUBLE_EQ(range.high.deg_and_mm()[i], high[i]);
  }
  EXPECT_TRUE(problems(options).empty());
}

TEST(PrecomputeOptions, RangesThatAreNoneAreRefused) {
  for (const char* text : {"rx",
                           "rx=",
                           "rx=1:",
                           "rx=2:1",
                           "tx=1",
                           "rx=1,rx=2",
                           "rw=1",
                           "rx=-3",
                           "rx=1,",
                           ",",
                           "rx=1:2:3",
                           "rx=nan",
                           "rx=1 ",
                           "x=1",
                           "rx=inf"}) {
    PrecomputeOptions options;
    options.rotation_range_deg = text;
    EXPECT_THROW((void)options.range(), UsageError) << text;
  }
  PrecomputeOptions far;
  far.rotation_range_deg = "rx=170:190";
  EXPECT_FALSE(problems(far).empty());
}

TEST(PrecomputeOptions, TakeAnOrbitAsText) {
  const Orbit orbit = orbit_of_text("--orbit", "axis=z,from=-90,to=+45.5,step=15");
  EXPECT_EQ(orbit.axis, 2);
  EXPECT_EQ(orbit.from_rad, -90.0 * kRadPerDeg);
  EXPECT_EQ(orbit.to_rad, 45.5 * kRadPerDeg);
  EXPECT_EQ(orbit.step_rad, 15.0 * kRadPerDeg);
  EXPECT_FALSE(orbit_of_text("--orbit", "to=9,axis=x,from=-9").step_rad.has_value());
  EXPECT_EQ(orbit.members_by, Orbit::MembersBy::Source);
  const std::string by = "axis=z,from=-9,to=9,members=by-";
  EXPECT_EQ(orbit_of_text("--orbit", by + "source").members_by, Orbit::MembersBy::Source);
  EXPECT_EQ(orbit_of_text("--orbit", by + "pose").members_by, Orbit::MembersBy::Pose);
  for (const char* text : {"",
                           "axis=z",
                           "axis=z,from=-90",
                           "axis=w,from=-90,to=90",
                           "axis=,from=-90,to=90",
                           "axis=z,from=-90,to=90,to=95",
                           "axis=z,from=90,to=-90",
                           "axis=z,from=-90,to=nan",
                           "axis=z,from=-90,to=90,step=0",
                           "axis=z,from=-90,to=90deg",
                           "axis=z,from=-90,to=90,by=10",
                           "axis=z,from=-90,to=90,members=10",
                           "axis=z,from=-9,to=9,members=by-pose,members=by-pose"}) {
    PrecomputeOptions options;
    options.orbit = *text == '\0' ? "=" : text;
    EXPECT_THROW(problems(options), UsageError) << text;
    EXPECT_TRUE(options.is_atlas());
  }
}

TEST(FieldDesignOfOptions, FitsTheViewpointsOfTheDefaultAlone) {
  PrecomputeOptions options;
  EXPECT_TRUE(options.design().fits_uv);
  EXPECT_EQ(options.in_force().uv_samples, "least-squares");
  EXPECT_EQ(options.in_force().in_force().uv_samples, "least-squares");
  EXPECT_EQ(deciding_options(options, kCastingStage).at("uv_samples"), "\"least-squares\"");
  EXPECT_EQ(options.training_selection().max_training_tiles, 32u * 4096u);
  options.preset = kDefaultPreset;
  options.uv_samples = "point";
  EXPECT_FALSE(options.design().fits_uv);
  EXPECT_EQ(options.design().slabs, design_preset_named(kDefaultPreset).design.slabs);
  EXPECT_EQ(option_texts(to_toml(options)).at("uv_samples"), "\"point\"");
  EXPECT_EQ(options.training_selection().max_training_tiles, 64u * 4096u);
  options.preset = kPaperPreset;
  options.uv_samples.reset();
  EXPECT_FALSE(options.in_force().uv_samples.has_value());
}

TEST(FieldDesignOfOptions, RefusesToFitTooFewViewpointsAndWhatAProbeCannotForecast) {
  PrecomputeOptions options;
  options.preset = kDefaultPreset;
  options.uv_nodes = 2;
  ASSERT_EQ(problems(options).size(), 1u);
  EXPECT_NE(problems(options)[0].find("uv_nodes = 2"), std::string::npos);
  options.uv_nodes = 3;
  EXPECT_TRUE(problems(options).empty());
  options = {};
  options.preset = "fine";
  options.uv_samples = "least-squares";
  ASSERT_EQ(problems(options).size(), 1u);
  EXPECT_NE(problems(options)[0].find("probe"), std::string::npos);
  options.uv_samples = "point";
  EXPECT_TRUE(problems(options).empty());
}

TEST(FieldDesignOfOptions, FiltersTheTilesOfTheDefaultAlone) {
  PrecomputeOptions options;
  EXPECT_TRUE(options.design().filters_tiles);
  EXPECT_EQ(options.in_force().in_force().tile_filter, "neighbours");
  EXPECT_EQ(option_texts(to_toml(options)).at("tile_filter"), "\"neighbours\"");
  options.preset = kDefaultPreset;
  options.tile_filter = "none";
  EXPECT_FALSE(options.design().filters_tiles);
  EXPECT_EQ(options.in_force().tile_filter, "none");
  options.preset = kPaperPreset;
  options.tile_filter.reset();
  EXPECT_FALSE(options.in_force().tile_filter.has_value());
  options.tile_filter = "neighbours";
  EXPECT_TRUE(problems(options).empty());
  EXPECT_TRUE(options.design().filters_tiles);
  options = {};
  options.preset = "fine";
  EXPECT_FALSE(options.in_force().tile_filter.has_value());
  options.tile_filter = "neighbours";
  ASSERT_EQ(problems(options).size(), 1u);
  EXPECT_NE(problems(options)[0].find("probe"), std::string::npos);
}

TEST(PrecomputeOptions, AnAtlasHasItsOwnPreset) {
  PrecomputeOptions options;
  options.orbit = "axis=z,from=-90,to=90";
  const FieldDesign of_field = design_preset_named(kDefaultPreset).design;
  const FieldDesign of_atlas = options.in_force().design();
  EXPECT_EQ(of_atlas, design_preset_named(kAtlasPreset).design);
  EXPECT_EQ(of_atlas, (FieldDesign{8, 12, 384, 16384, "cubic", 64}));
  EXPECT_NE(of_atlas, of_field);
  options.preset = kDefaultPreset;
  EXPECT_EQ(options.in_force().design(), of_field);
  // A typed part makes the other parts the paper's, as for a single field.
  options.preset.reset();
  options.uv_nodes = 12;
  EXPECT_EQ(options.design().slabs, 1);
}

}  // namespace
}  // namespace af
