// SPDX-License-Identifier: Apache-2.0
#include "files/options_toml.h"

#include <limits>

#include <gtest/gtest.h>

namespace af {
namespace {

struct Options {
  std::string name = "a\"b\\\n\x1b";
  std::filesystem::path input = "in.toml";
  double step_mm = 0.1;
  std::vector<int> nodes = {2, 3};
  std::vector<std::string> chains;
  std::optional<double> share;
  std::uint64_t seed = std::numeric_limits<std::uint64_t>::max() / 2;
  bool is_quiet = false;

  void describe(Fields& field) {
    field("name", name, "");
    field("input", input, "").input();
    field("step_mm", step_mm, "").decides("cast");
    field("nodes", nodes, "");
    field("chain", chains, "");
    field("share", share, "").recorded_when_unset("tiles", "64").decides("train");
    field("seed", seed, "").not_deciding("a test");
    field("quiet", is_quiet, "").not_recorded("a test");
  }
};

TEST(OptionsToml, HasWhatWasGivenInTheOrderOfTheDescription) {
  EXPECT_EQ(
      to_toml(Options()),
      "name = \"a\\\"b\\\\\\u000A\\u001B\"\ninput = \"in.toml\"\nstep_mm = 0.1\nnodes = [2, 3]\n"
      "tiles = 64\nseed = 9223372036854775807\n");
}

TEST(OptionsToml, LongListsTakeALinePerValueAndReadBack) {
  Options options;
  options.chains = {std::string(70, 'x'), std::string(70, 'y')};
  const std::string toml = to_toml(options);
  EXPECT_NE(toml.find("chain = [\n  \"xxx"), std::string::npos) << toml;
  EXPECT_EQ(option_texts(toml).at("chain"),
            "[  \"" + std::string(70, 'x') + "\",  \"" + std::string(70, 'y') + "\",]");
  EXPECT_EQ(option_texts(toml).at("tiles"), "64");
}

TEST(OptionsToml, DecidingOptionsAreNeitherInputsNorNamedAsIdle) {
  Options options;
  OptionTexts texts = deciding_options(options);
  EXPECT_EQ(texts.size(), 4U);
  EXPECT_EQ(texts.at("tiles"), "64");
  options.share = 1.0 / 3.0;
  EXPECT_EQ(deciding_options(options, "train"), (OptionTexts{{"share", "0.3333333333333333"}}));
  EXPECT_EQ(deciding_options(options, "cast"), (OptionTexts{{"step_mm", "0.1"}}));
}

TEST(TomlFloat, IsPlainWherePeopleReadIt) {
  EXPECT_EQ(toml_float(200000.0), "200000.0");
  EXPECT_EQ(toml_float(1e-4), "0.0001");
  EXPECT_EQ(toml_float(1e300), "1e+300");
  EXPECT_EQ(toml_float(-0.0), "-0.0");
  EXPECT_EQ(toml_float(std::numeric_limits<double>::infinity()), "inf");
}

}  // namespace
}  // namespace af
