// SPDX-License-Identifier: Apache-2.0
#include "cli/bind_options.h"

#include <map>
#include <string>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/command_help.h"

namespace af::cli {
namespace {

using testing::ElementsAre;

struct Options {
  std::string ct;
  std::string phantom;
  int uv_nodes = 64;
  std::uint64_t memory_bytes = 0;
  bool has_checkpoint = true;
  std::vector<int> sides;
  std::vector<std::string> hints;
  std::optional<std::string> preset;
  std::optional<double> share = 0.1;
  double hours = 5.0;
  std::string internal = "x";

  void describe(Fields& field) {
    field("ct", ct, "A CT").one_of_group("Patient");
    field("phantom", phantom, "A phantom").one_of_group("Patient");
    field("uv_nodes", uv_nodes, "Nodes").excludes({"--preset"});
    field("memory_bytes", memory_bytes, "Memory").as("-m,--memory").size().default_in_help();
    field("checkpoint", has_checkpoint, "None").as("--no-checkpoint").off_switch();
    field("sides", sides, "Sides").count(2).comma_separated();
    field("hints", hints, "Hints").as("--hint").one_at_a_time();
    field("preset", preset, "Preset").choice({"fast", "paper"});
    field("share", share, "Share");
    field("hours", hours, "Hours").above(0.0).checked_when_typed();
    field("internal", internal, "").no_option("a test");
  }
};

/// Options that take lists, and a positional word that must not join the list before it.
struct ListOptions {
  std::vector<int> sides;
  std::optional<std::array<double, 3>> point;
  std::uint64_t memory_bytes = 0;
  std::string file;

  void describe(Fields& field) {
    field("sides", sides, "Sides").count(2).comma_separated();
    field("point", point, "A point");
    field("memory_bytes", memory_bytes, "Memory").as("-m").size();
    field("file", file, "A file").as("file");
  }
};

template <typename OptionsType = Options>
OptionsType parsed(const std::string& line) {
  OptionsType options;
  CLI::App app{"test"};
  bind_options(app, options);
  app.parse(line, false);
  return options;
}

TEST(BindOptions, SizesTakeDecimals) {
  const auto bytes = [](const std::string& size) {
    return parsed("--ct a.mha -m '" + size + "'").memory_bytes;
  };
  EXPECT_EQ(bytes("3.5MB"), 3'500'000u);
  EXPECT_EQ(bytes("1.1mb"), 1'100'000u);
  EXPECT_EQ(bytes("0.5KiB"), 512u);
  EXPECT_EQ(bytes("2.25 Gi"), 2'415'919'104u);
  EXPECT_EQ(bytes("1.0004kB"), 1000u);
  EXPECT_EQ(bytes("8MB"), 8'000'000u);
  for (const char* size : {"0.4", "3.5XB", "3.5.1MB", "nan.MB", "-3.5MB", "99999.5EB"})
    EXPECT_THROW(parsed(std::string("--ct a.mha -m=") + size), CLI::ParseError) << size;
}

TEST(BindOptions, ReadsEveryKindOfField) {
  const Options options = parsed(
      "--ct a.mha --uv-nodes 9 -m 2kb --no-checkpoint --sides 3,4 --hint a=1 --hint b=2 "
      "--share 0.25");
  EXPECT_EQ(options.ct, "a.mha");
  EXPECT_EQ(options.uv_nodes, 9);
  EXPECT_EQ(options.memory_bytes, 2000U);
  EXPECT_FALSE(options.has_checkpoint);
  EXPECT_THAT(options.sides, ElementsAre(3, 4));
  EXPECT_THAT(options.hints, ElementsAre("a=1", "b=2"));
  EXPECT_EQ(options.share, 0.25);
}

TEST(BindOptions, AListTakesCommasOrWordsAndNothingBehindIt) {
  for (const char* point : {"--point=-10.5,20,30", "--point -10.5,20,30", "--point -10.5 20 30"})
    for (const char* sides : {"--sides 3,4", "--sides=3,4", "--sides 3 4"})
      for (const std::string& line : {std::string(point) + " " + sides + " f -m 2kb",
                                      std::string(sides) + " " + point + " f -m 2kb",
                                      std::string("f -m 2kb ") + sides + " " + point}) {
        const ListOptions options = parsed<ListOptions>(line);
        EXPECT_EQ(options.point, (std::array{-10.5, 20.0, 30.0})) << line;
        EXPECT_THAT(options.sides, ElementsAre(3, 4)) << line;
        EXPECT_EQ(options.file, "f") << line;
        EXPECT_EQ(options.memory_bytes, 2000U) << line;
      }
  for (const char* point : {"--point 1,2", "--point 1,2,3,4", "--point 1,2,3 4,5,6", "--point ,,"})
    EXPECT_THROW(parsed<ListOptions>(std::string("f ") + point), CLI::ParseError) << point;
}

TEST(BindOptions, RefusesWhatTheDescriptionExcludes) {
  EXPECT_THROW(parsed("--uv-nodes 9"), CLI::RequiredError);
  EXPECT_THROW(parsed("--ct a --phantom b"), CLI::RequiredError);
  EXPECT_THROW(parsed("--ct a --uv-nodes 9 --preset fast"), CLI::ExcludesError);
  EXPECT_THROW(parsed("--ct a --preset slow"), CLI::ValidationError);
  EXPECT_THROW(parsed("--ct a --hours 0"), CLI::ValidationError);
  EXPECT_THROW(parsed("--ct a --hours 1x"), CLI::ParseError);
  EXPECT_THROW(parsed("--ct a --sides 3"), CLI::ParseError);
  EXPECT_THROW(parsed("--ct a --hint a=1 b=2"), CLI::ExtrasError);
  EXPECT_THROW(parsed("--ct a --internal y"), CLI::ExtrasError);
}

TEST(BindOptions, HelpShowsDefaults) {
  Options options;
  CLI::App app{"test"};
  bind_options(app, options);
  std::map<std::string, OptionHelp> help;
  for (const OptionHelp& option : command_help(app).options) help[option.long_name()] = option;
  EXPECT_EQ(help["--uv-nodes"].value_word, "INT");
  EXPECT_EQ(help["--uv-nodes"].default_text, "64");
  EXPECT_EQ(help["--share"].default_text, "0.1");
  EXPECT_THAT(help["--preset"].choices, ElementsAre("fast", "paper"));
  EXPECT_EQ(help["--preset"].default_text, "");
  EXPECT_EQ(help["--memory"].default_text, "");
}

}  // namespace
}  // namespace af::cli
