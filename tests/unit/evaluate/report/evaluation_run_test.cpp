// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/evaluation_run.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "evaluate/report/sample_summary_json.h"
#include "files/output_file.h"
#include "support/test_paths.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

TEST(SummaryJson, KeepsWhatJsonLacks) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(number_of(json::parse(number_json(infinity).dump())), infinity);
  EXPECT_TRUE(std::isnan(number_of(json::parse(number_json(std::nan("")).dump()))));
  EXPECT_EQ(number_of(number_json(0.1)), 0.1);
}

/// A folder with `text` as NAME/summary.json.
void write_summary(const test::ScratchFolder& folder,
                   const std::string& name,
                   const std::string& text) {
  std::filesystem::create_directories(folder / name);
  write_text_file(folder / name / "summary.json", text);
}

std::string minimal_summary(const std::string& kind) {
  return json({{"format", "attenuation-fields evaluation"}, {"format_version", 1}, {"kind", kind}})
      .dump();
}

TEST(FindRuns, FindsRegistrationsBelowAFolderOnceAndInAFixedOrder) {
  const test::ScratchFolder folder;
  write_summary(folder, "b", minimal_summary("registration"));
  write_summary(folder, "a/run", minimal_summary("registration"));
  write_summary(folder, "a/quality", minimal_summary("image-quality"));
  write_summary(folder, "other", "{\"format\": \"of another program\"}");
  const auto runs = find_runs({folder.path(), folder / "a"});
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0].folder.filename(), "run");
  EXPECT_EQ(runs[1].folder.filename(), "b");
}

TEST(FindRuns, LeavesOutRepeatsOfSingleStartsUnlessTheyAreNamed) {
  const test::ScratchFolder folder;
  write_summary(folder, "run", minimal_summary("registration"));
  json repeat = json::parse(minimal_summary("registration"));
  repeat["only_start"] = 12;
  write_summary(folder, "run/repeats/skull-field-12", repeat.dump());
  EXPECT_EQ(find_runs({folder.path()}).size(), 1u);
  EXPECT_EQ(find_runs({folder / "run/repeats/skull-field-12"}).size(), 1u);
}

TEST(FindRuns, RefusesWhatIsNotASoundRun) {
  const test::ScratchFolder folder;
  EXPECT_THROW(find_runs({folder / "missing"}), FileError);
  EXPECT_THROW(find_runs({folder.path()}), InputError);
  write_summary(folder, "truncated", minimal_summary("registration").substr(0, 40));
  EXPECT_THROW(find_runs({folder / "truncated"}), FileError);
  write_summary(folder, "list", "[1, 2]");
  EXPECT_THROW(find_runs({folder / "list"}), FileError);
  json newer = json::parse(minimal_summary("registration"));
  newer["format_version"] = 2;
  write_summary(folder, "newer", newer.dump());
  EXPECT_THROW(find_runs({folder / "newer"}), FileError);
}

TEST(FindRuns, TakeNothingThatALinkBringsFromElsewhere) {
  const test::ScratchFolder folder;
  write_summary(folder, "mine", minimal_summary("registration"));
  write_text_file(folder / "secret.csv", "a\n1\n");
  std::filesystem::create_directory(folder / "theirs");
  std::filesystem::create_symlink("../mine/summary.json", folder / "theirs/summary.json");
  EXPECT_THROW(find_runs({folder / "theirs"}), InputError);
  std::filesystem::create_symlink("../secret.csv", folder / "mine/registrations.csv");
  EXPECT_THROW(find_runs({folder / "mine"}).front().read_registrations([](const CsvTable&) {}),
               FileError);
}

}  // namespace
}  // namespace af::evaluation
