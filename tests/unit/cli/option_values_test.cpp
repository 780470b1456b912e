// SPDX-License-Identifier: Apache-2.0
#include "cli/option_values.h"

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

namespace af::cli {
namespace {

/// One option of each type that programs have.
struct Options {
  std::uint64_t seed = 0;
  std::uint64_t limit = 0;
  int count = 0;
  std::optional<int> start;
  double step = 0.0;
  std::optional<double> share;
  std::optional<std::array<double, 3>> triple;
  std::vector<double> list;
  std::filesystem::path path;
  std::string text;
};

/// The message about the options of a subcommand; empty when they are accepted.
std::string complaint(const std::string& words) {
  CLI::App app{"test"};
  Options options;
  CLI::App* command = app.add_subcommand("work", "");
  command->add_option("--seed", options.seed, "");
  command->add_option("--limit", options.limit, "")->transform(CLI::AsSizeValue(true));
  command->add_option("--count", options.count, "");
  command->add_option("--start", options.start, "");
  command->add_option("--step", options.step, "");
  command->add_option("--share", options.share, "");
  command->add_option("--triple", options.triple, "")->delimiter(',');
  command->add_option("--list", options.list, "")->delimiter(',');
  command->add_option("--path", options.path, "");
  CLI::App* group = command->add_option_group("group", "");
  group->add_option("--text", options.text, "");
  try {
    app.parse("work " + words, false);
    check_option_values(app);
  } catch (const CLI::ParseError& error) {
    return error.what();
  }
  return {};
}

TEST(OptionValues, SoundOnesAreAccepted) {
  for (const char* words : {"--seed 18446744073709551615",
                            "--seed 0",
                            "--limit 8GB",
                            "--limit 300",
                            "--limit '8 kb'",
                            "--count -3",
                            "--count +3",
                            "--start 7",
                            "--step 1e-3",
                            "--step -.5",
                            "--share 5.",
                            "--triple -1,2.5,+3e2",
                            "--list 1,2",
                            "--path a",
                            "--text 5x"})
    EXPECT_EQ(complaint(words), "") << words;
}

TEST(OptionValues, WhatIsNoNumberOfTheTypeIsRefusedByName) {
  const std::array<std::pair<const char*, std::vector<const char*>>, 8> refused = {
      {{"--seed", {"-1", "-5", "18446744073709551616", "1e30", "5x", "0x10", "010", "1.5", "nan"}},
       {"--limit", {"-5", "-5GB", "99999999999999999999", "99999999999GB", "nan"}},
       {"--count",
        {"99999999999999999999", "3000000000", "1e3", "5x", "0x10", "010", "-010", "inf"}},
       {"--start", {"5x", "010", "-99999999999999999999"}},
       {"--step", {"nan", "inf", "-inf", "1e999", "5x", "0x1p3", "infinity", "1,5"}},
       {"--share", {"nan", "inf", "5x"}},
       {"--triple", {"1,2,nan", "1,inf,3", "1,2,3x", "1,,3"}},
       {"--list", {"1,nan", "0x10"}}}};
  for (const auto& [name, values] : refused)
    for (const char* value : values) {
      const std::string message = complaint(std::string(name) + "=" + value);
      EXPECT_NE(message.find(name), std::string::npos) << name << ' ' << value << ": " << message;
    }
}

TEST(OptionValues, TextsAreNotEmpty) {
  EXPECT_NE(complaint("--path ''").find("--path"), std::string::npos);
  EXPECT_NE(complaint("--text \"\"").find("--text"), std::string::npos);
}

}  // namespace
}  // namespace af::cli
