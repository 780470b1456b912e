// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include "cli/app_main.h"
#include "files/shell_words.h"

namespace af::cli {
namespace {

TEST(GivenOptions, AreThoseTypedButTheOnesLeftOut) {
  CLI::App app{"test"};
  CLI::App* command = app.add_subcommand("work", "");
  std::vector<std::string> fields;
  std::string name;
  std::string output;
  double step = 1.0;
  bool is_fast = false;
  command->add_option("--field", fields, "")->take_all();
  command->add_option("--name", name, "");
  command->add_option("--step", step, "")->capture_default_str();
  command->add_flag("--fast", is_fast, "");
  command->add_option("-o,--output", output, "");
  app.parse("work --field A=a.h5 --name \"it is\" --field=B=b.h5 --fast -o x", false);
  EXPECT_EQ(given_options(*command, {"--output"}),
            " --field A=a.h5 --field B=b.h5 --name 'it is' --fast");
  EXPECT_EQ(given_options(*command, {"--field", "--name", "--fast"}), " --output x");
}

TEST(ShellQuoted, KeepsWordsWholeAndQuotesInsideThem) {
  EXPECT_EQ(shell_quoted("A=/x/a-b.h5"), "A=/x/a-b.h5");
  EXPECT_EQ(shell_quoted("it's"), "'it'\\''s'");
  EXPECT_EQ(shell_quoted(""), "''");
}

}  // namespace
}  // namespace af::cli
