// SPDX-License-Identifier: Apache-2.0
#include "cli/command_help.h"

#include <algorithm>
#include <memory>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/bind_options.h"
#include "cli/help_pages.h"
#include "cli/shell_completion.h"
#include "cli/slicer_module.h"

namespace af::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

struct ShownOptions {
  std::filesystem::path study;
  std::filesystem::path output;
  std::string way = "quick";
  std::optional<std::string> preset;
  int nodes = 64;
  double share = 0.25;
  double tiny = 1e-9;
  double lone = 0.5;
  std::optional<double> unset;
  std::array<double, 2> window = {0.5, 99.5};
  bool is_exact = false;

  void describe(Fields& field) {
    field("study", study, "A study | of <one> case").stands_for(PathRole::InputFile, ".toml");
    field("output", output, "Results")
        .as("-o,--output")
        .stands_for(PathRole::OutputFolder)
        .required();
    field("way", way, "How").choice({"quick", "exact"});
    field("preset", preset, "Preset").choice({"fast", "paper"});
    field("nodes", nodes, "Nodes").within(2, 128);
    field("share", share, "Share").at_least(0.0);
    field("tiny", tiny, "Tiny");
    field("lone", lone, "Lone").excludes({"--unset"});
    field("unset", unset, "Unset");
    field("window", window, "Window").comma_separated();
    field("exact", is_exact, "A flag");
  }
};

CommandHelp shown_help() {
  static ShownOptions options;
  static CLI::App app{"Shows options. Quickly."};
  if (app.get_name().empty()) {
    app.name("af-show");
    bind_options(app, options);
  }
  return command_help(app);
}

/// The help of an option of `command` that no struct describes.
OptionHelp plain_help(CLI::App& command, CLI::App& program) {
  int nodes = 0;
  command.add_option("--nodes", nodes, "");
  CommandHelp help = command_help(program);
  if (!help.commands.empty()) help = help.commands.back();
  for (const OptionHelp& option : help.options)
    if (option.long_name() == "--nodes") return option;
  return {};
}

// A later program's options may lie in memory where an earlier one's lay.
TEST(CommandHelp, HasNothingOfAnotherProgramOrCommand) {
  for (int turn = 0; turn < 20; ++turn) {
    auto described = std::make_unique<CLI::App>("described");
    ShownOptions options;
    bind_options(*described, options);
    described.reset();
    CLI::App program{"plain"};
    EXPECT_EQ(plain_help(program, program).constraint, "") << turn;
  }
  CLI::App program{"program"};
  ShownOptions options;
  bind_options(*program.add_subcommand("described", ""), options);
  EXPECT_EQ(command_help(program).commands.front().options.size(), 12U);
  EXPECT_EQ(plain_help(*program.add_subcommand("plain", ""), program).constraint, "");
}

TEST(MarkdownPage, HasARowForEveryOption) {
  const std::string page = markdown_page(shown_help());
  EXPECT_THAT(page, HasSubstr("# af-show\n\nShows options. Quickly.\n"));
  EXPECT_THAT(page, HasSubstr("| `--study` | `PATH` |  | A study \\| of \\<one> case |\n"));
  EXPECT_THAT(page, HasSubstr("| `-o`, `--output` | `PATH` |  | Results. Required |\n"));
  EXPECT_THAT(page, HasSubstr("| `--way` | `TEXT` | `quick` | How. One of: quick, exact |\n"));
  EXPECT_THAT(page, HasSubstr("| `--nodes` | `INT` | `64` | Nodes. Must be between 2 and 128 |\n"));
  EXPECT_THAT(page, HasSubstr("| `--exact` |  |  | A flag |\n"));
}

TEST(MarkdownPage, ListsChoicesThatTheTextDoesNotExplain) {
  CommandHelp program = shown_help();
  for (OptionHelp& option : program.options)
    if (option.long_name() == "--way") option.text = "quick: soon; exact: later";
  EXPECT_THAT(markdown_page(program),
              HasSubstr("| `--way` | `TEXT` | `quick` | quick: soon; exact: later |\n"));
}

TEST(MarkdownPage, NamesOptionsThatAnEarlierCommandHasAlike) {
  CommandHelp program = shown_help();
  CommandHelp command{"again", "Shows more.", program.options, {}};
  OptionHelp& way = *std::find_if(command.options.begin(),
                                  command.options.end(),
                                  [](const auto& o) { return o.long_name() == "--way"; });
  way.default_text = "exact";
  std::erase_if(command.options, [](const OptionHelp& option) {
    return option.long_name() != "--way" && option.long_name() != "--output" &&
           option.long_name() != "--nodes";
  });
  program.commands = {command};
  const std::string page = markdown_page(program);
  EXPECT_THAT(page,
              HasSubstr("## af-show again\n\nShows more.\n\n"
                        "| Option | Value | Default | What it does |\n|---|---|---|---|\n"
                        "| `--way` | `TEXT` | `exact` | How. One of: quick, exact |\n\n"
                        "As above: `--output`, `--nodes`.\n"));
}

TEST(CommandHelp, HasTheHelpOfAProgramButNotOfItsGroupsOfOptions) {
  CLI::App program{"program"};
  std::string file;
  program.add_option_group("one of")->add_option("--file", file, "A file");
  std::vector<std::string> names;
  for (const OptionHelp& option : command_help(program).options)
    names.push_back(option.long_name());
  EXPECT_THAT(names, testing::ElementsAre("--help", "--file"));
}

TEST(ManPage, SaysWhatTheProgramDoesInItsName) {
  const std::string page = man_page(shown_help(), "1.2");
  EXPECT_THAT(page, HasSubstr(".SH NAME\naf\\-show \\- Shows options\n"));
  EXPECT_THAT(page, HasSubstr("\\fB\\-o\\fR, \\fB\\-\\-output\\fR \\fIPATH\\fR\n"));
}

TEST(SlicerXml, GivesAParameterTheTypeThatCarriesItsMeaning) {
  const std::string xml = slicer_xml(shown_help(), "Show", "1.2");
  EXPECT_THAT(xml, HasSubstr("<file fileExtensions=\".toml\">\n      <name>study</name>"));
  EXPECT_THAT(xml, HasSubstr("A study | of &lt;one&gt; case"));
  EXPECT_THAT(xml, HasSubstr("<directory>\n      <name>output</name>\n      <flag>o</flag>"));
  EXPECT_THAT(xml, HasSubstr("<string-enumeration>\n      <name>way</name>"));
  EXPECT_THAT(xml,
              HasSubstr("<constraints><minimum>2</minimum><maximum>128</maximum><step>1</step>"));
  EXPECT_THAT(xml, HasSubstr("<default>0.5,99.5</default>"));
  EXPECT_THAT(xml, HasSubstr("<double>\n      <name>share</name>"));
  EXPECT_THAT(xml, HasSubstr("<boolean>\n      <name>exact</name>"));
  EXPECT_THAT(xml, Not(HasSubstr("help")));
}

TEST(SlicerXml, MakesATextOfWhatMustNotAlwaysBeGiven) {
  const std::string xml = slicer_xml(shown_help(), "Show", "1.2");
  for (const char* name : {"preset", "unset", "tiny", "lone"})
    EXPECT_THAT(xml, HasSubstr(std::string("<string>\n      <name>") + name + "</name>"));
}

TEST(Completion, NamesOptionsAndChoices) {
  const std::string bash = bash_completion(shown_help());
  EXPECT_THAT(bash, HasSubstr("\" --way\") names=\"quick exact\" ;;"));
  EXPECT_THAT(bash, HasSubstr("complete -o default -F _af_show af-show\n"));
  const std::string zsh = zsh_completion(shown_help());
  EXPECT_THAT(zsh, HasSubstr("'(-o --output)'{-o,--output}'[Results]:PATH:_files'"));
  EXPECT_THAT(zsh, HasSubstr("'--way[How]:TEXT:(quick exact)'"));
}

TEST(WithDashes, TurnsUnderscoresOfKnownOptionsOnly) {
  CLI::App app{"test"};
  CLI::App* command = app.add_subcommand("work", "");
  double value = 0.0;
  app.add_option("--start-pose", value, "");
  command->add_option("--pose-count", value, "");
  EXPECT_EQ(with_dashes(app, "--start_pose"), "--start-pose");
  EXPECT_EQ(with_dashes(app, "--start_pose=a_b"), "--start-pose=a_b");
  EXPECT_EQ(with_dashes(app, "--pose_count"), "--pose-count");
  EXPECT_EQ(with_dashes(app, "--no_such"), "--no_such");
  EXPECT_EQ(with_dashes(app, "a_b"), "a_b");
}

}  // namespace
}  // namespace af::cli
