// SPDX-License-Identifier: Apache-2.0
#include "register/result_files.h"

#include <filesystem>
#include <limits>

#include <gtest/gtest.h>

#include "io/output_file.h"
#include "io/pose_file.h"
#include "support/test_paths.h"
#include "unit/register/registration_cases.h"

namespace af::registration {
namespace {

RegistrationRecord record_of(std::int64_t start_index, double similarity) {
  RegistrationRecord record;
  record.start_index = start_index;
  record.result.similarity = similarity;
  record.result.room_from_ct = pose_from_parameters(
      PoseFrame(), PoseParameters::from_deg_and_mm({10.0, -20.0, 30.0, 1.0, 2.0, 3.0}));
  record.result.evaluations = 123;
  record.result.trace.push_back({0, 5.0, 13, 0.5, {}});
  return record;
}

RunDescription some_run() {
  RunDescription run{"skull", "raycast", {}};
  run.provenance.program = "af-register";
  run.provenance.command_line = "af-register --study s";
  return run;
}

TEST(BestRecord, IsTheHighestFiniteSimilarityAndTheFirstOfEquals) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(best_record({record_of(0, nan), record_of(1, 2.0), record_of(2, 3.0)}), 2U);
  EXPECT_EQ(best_record({record_of(0, nan), record_of(1, 2.0), record_of(2, 2.0)}), 1U);
  EXPECT_EQ(best_record({record_of(0, nan), record_of(1, nan)}), 0U);
}

TEST(ResultFiles, PosesReadBackAndNothingUnfinishedRemains) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  const RegistrationRecord record = record_of(0, 1.5);
  write_result_files(record, *small.problem, some_run(), folder.path());
  // result.json holds the digits JSON writers keep, the others 17: all to 1e-12 of a millimetre.
  constexpr double kDigits = 1e-12;
  for (const char* name : {"result.json", "pose.toml", "result.tfm"})
    EXPECT_TRUE(read_pose(folder / name).isApprox(record.result.room_from_ct, kDigits)) << name;
  for (const char* name : {"AP-overlay.png", "LAT-overlay.png", "reproduce.sh"})
    EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    EXPECT_EQ(entry.path().string().find("partial"), std::string::npos) << entry.path();
}

TEST(ResultFiles, JsonTellsTheRunAndWritesNullForWhatDoesNotExist) {
  const test::SmallCase small = test::small_case();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const nlohmann::json json = result_json(record_of(4, nan), *small.problem, some_run());
  EXPECT_TRUE(json.at("similarity").is_null());
  EXPECT_TRUE(json.at("tre_mm").is_null());
  EXPECT_EQ(json.at("case"), "skull");
  EXPECT_EQ(json.at("start_index"), 4);
  EXPECT_EQ(json.at("evaluations"), 123);
  EXPECT_EQ(json.at("stop_reason"), "step-below-final");
  EXPECT_EQ(json.at("trace").at(0).at("step_mm"), 5.0);
  EXPECT_NEAR(json.at("parameters_relative_to_nominal").at("rotation_deg").at(1).get<double>(),
              -20.0,
              1e-9);
}

TEST(ResultFiles, TableRowsAreSortedByStartIndex) {
  const test::SmallCase small = test::small_case();
  RegistrationRecord with_errors = record_of(0, 1.0);
  with_errors.errors = TargetErrors{"fiducials", 3.0, 0.25};
  const CsvTable table =
      registrations_table({record_of(2, 2.0), with_errors}, *small.problem, some_run());
  ASSERT_EQ(table.row_count(), 2U);
  EXPECT_EQ(table.text(0, "start_index"), "0");
  EXPECT_EQ(table.text(1, "start_index"), "2");
  EXPECT_EQ(table.number(0, "tre_mm"), 0.25);
  EXPECT_EQ(table.text(1, "tre_mm"), "nan");
  EXPECT_NEAR(table.number(0, "final_rz_deg"), 30.0, 1e-9);
  EXPECT_EQ(table.text(0, "renderer"), "raycast");
}

TEST(ResultFiles, ARunOfSeveralStartsLeavesATableAndTheBestResult) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  const std::string summary =
      write_run({record_of(0, 1.0), record_of(1, 2.0)}, *small.problem, some_run(), folder.path());
  EXPECT_NE(summary.find("highest similarity: start 1"), std::string::npos) << summary;
  EXPECT_EQ(CsvTable::read(folder / "registrations.csv").row_count(), 2U);
  EXPECT_NE(read_text_file(folder / "result.json").find("\"start_index\": 1"), std::string::npos);
}

}  // namespace
}  // namespace af::registration
