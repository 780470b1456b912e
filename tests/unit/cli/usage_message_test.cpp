// SPDX-License-Identifier: Apache-2.0
#include "cli/usage_message.h"

#include <array>
#include <string>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace af::cli {
namespace {

/// A program like ours: options, a required one among them, and sub-commands.
std::string message_for(const std::string& line, bool has_commands = false) {
  CLI::App app{"test", "program"};
  std::array<double, 3> rotation{};
  std::string ct;
  std::string output;
  int threads = 1;
  CLI::App* const command = has_commands ? app.add_subcommand("registration", "") : &app;
  if (has_commands) {
    app.add_subcommand("report", "");
    app.require_subcommand(1);
  }
  command->add_option("--ct", ct, "");
  command->add_option("--rotation-deg", rotation, "")->delimiter(',');
  command->add_option("--threads", threads, "");
  command->add_option("-o,--output", output, "")->required();
  try {
    app.parse(line, false);
  } catch (const CLI::ParseError& error) {
    return usage_message(app, error);
  }
  return "";
}

TEST(UsageMessage, NamesTheUnknownOptionBeforeTheOneThatIsMissingForIt) {
  EXPECT_EQ(message_for("--ctt x"), "unknown option '--ctt': did you mean '--ct'?");
  EXPECT_EQ(message_for("--ouput x"), "unknown option '--ouput': did you mean '--output'?");
  EXPECT_EQ(message_for("--ct x"), "--output is required");
}

TEST(UsageMessage, TakesTheBeginningOfANameForIt) {
  EXPECT_EQ(message_for("-o x --rotation 1,2,3"),
            "unknown option '--rotation': did you mean '--rotation-deg'?");
  EXPECT_EQ(message_for("-o x --rotation=1,2,3"),
            "unknown option '--rotation': did you mean '--rotation-deg'?");
}

TEST(UsageMessage, GuessesNothingThatIsNotSimilar) {
  EXPECT_EQ(message_for("-o x --kilovolts 3"), "unknown option '--kilovolts'");
}

TEST(UsageMessage, NamesTheSubCommandThatWasMeant) {
  EXPECT_EQ(message_for("regstration -o x", true),
            "unknown sub-command 'regstration': did you mean 'registration'?");
  EXPECT_EQ(message_for("pictures", true),
            "unknown sub-command 'pictures': choose one of registration, report");
  EXPECT_EQ(message_for("registration --rotaton-deg 1,2,3", true),
            "unknown option '--rotaton-deg': did you mean '--rotation-deg'?");
}

TEST(UsageMessage, SaysWhatAnOptionTakes) {
  EXPECT_EQ(message_for("-o x --threads two"), "--threads takes INT, not 'two'");
  // The third number is taken from what follows.
  EXPECT_THAT(message_for("--rotation-deg 1,2 -o x.png"), testing::EndsWith(", not '1,2,-o'"));
  EXPECT_THAT(message_for("-o x --rotation-deg 1,2"), testing::StartsWith("--rotation-deg takes "));
}

TEST(UsageMessage, SaysThatAWordStandsBehindNoOption) {
  EXPECT_EQ(message_for("-o x study.toml"),
            "'study.toml' was not expected: no option before it takes this value");
}

}  // namespace
}  // namespace af::cli
