// SPDX-License-Identifier: Apache-2.0
#include "register/results/registration_results.h"

#include <filesystem>
#include <limits>

#include <gtest/gtest.h>

#include "base/error.h"
#include "files/output_file.h"
#include "study/pose_file.h"
#include "support/test_paths.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

RegistrationRecord record_of(std::int64_t start_index, double similarity) {
  RegistrationRecord record;
  record.start_index = start_index;
  record.result.similarity = similarity;
  record.result.chain = "edges";
  record.result.room_from_ct = pose_from_parameters(
      PoseFrame(), PoseParameters::from_deg_and_mm({10.0, -20.0, 30.0, 1.0, 2.0, 3.0}));
  record.result.evaluations = 123;
  record.result.trace.push_back({0, 5.0, 13, 0.5, {}});
  return record;
}

RunDescription some_run() {
  RunDescription run{"skull", "raycast", {}, {}, {}};
  run.provenance.program = "af-register";
  run.provenance.command_line = "af-register --study s";
  return run;
}

/// A record like that of record_of(), with a confidence that says whether it is found.
RegistrationRecord judged_record(std::int64_t start_index, double similarity, double confidence) {
  RegistrationRecord record = record_of(start_index, similarity);
  record.view_values = {{0.8, 0.8}, {0.8, 0.8}};
  record.uncertainty.confidence = confidence;
  record.uncertainty.tre_rms_mm = 0.2;
  record.uncertainty.tre_95_mm = 0.5;
  return record;
}

TEST(BestRecord, IsNoneThatIsNotFoundBesideOthers) {
  EXPECT_EQ(best_record({judged_record(0, 9.0, 0.0), judged_record(1, 2.0, 0.4)}), 1U);
  EXPECT_EQ(best_record({judged_record(0, 9.0, 0.0), judged_record(1, 2.0, 0.01)}), 0U);
}

TEST(ResultFiles, WhatIsNotFoundHasNoPoseThatAScriptCouldTake) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  write_result_files(judged_record(0, 1.5, 0.995), *small.problem, some_run(), folder.path());
  nlohmann::json json = result_json(judged_record(0, 1.5, 0.995), *small.problem, some_run());
  EXPECT_EQ(json.at("verdict"), "found");
  EXPECT_EQ(json.at("views").at("verdict"), "no fault found");
  // What an earlier run found must go.
  write_result_files(judged_record(0, 1.5, 0.0), *small.problem, some_run(), folder.path());
  for (const char* name : {"pose.toml", "result.tfm"})
    EXPECT_FALSE(std::filesystem::exists(folder / name)) << name;
  EXPECT_TRUE(std::filesystem::exists(folder / "rejected-pose.toml"));
  EXPECT_THROW(read_pose(folder / "result.json"), InputError);
  json = result_json(judged_record(0, 1.5, 0.0), *small.problem, some_run());
  EXPECT_EQ(json.at("verdict"), "not found");
  EXPECT_FALSE(json.at("verdict_reason").get<std::string>().empty());
  EXPECT_TRUE(json.contains("rejected_room_from_ct"));
  EXPECT_FALSE(json.contains("room_from_ct"));
  // The reverse must hold as well.
  write_result_files(judged_record(0, 1.5, 0.995), *small.problem, some_run(), folder.path());
  EXPECT_TRUE(std::filesystem::exists(folder / "result.tfm"));
  EXPECT_FALSE(std::filesystem::exists(folder / "rejected-pose.toml"));
}

TEST(ResultFiles, AFindingAboutTheXraysMakesAResultDoubtful) {
  const test::SmallCase small = test::small_case();
  RegistrationRecord record = judged_record(0, 1.5, 0.995);
  record.diagnosis.messages = {"views 'AP' and 'LAT' have the same X-ray, pixel for pixel"};
  const nlohmann::json json = result_json(record, *small.problem, some_run());
  EXPECT_EQ(json.at("verdict"), "doubtful");
  EXPECT_EQ(json.at("views").at("verdict"), "suspicious");
  EXPECT_EQ(json.at("views").at("findings").size(), 1U);
  EXPECT_EQ(json.at("views").at("cameras").at(1).at("camera"), "LAT");
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

TEST(ResultFiles, WithoutPicturesNoneAreLeft) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  RunDescription run = some_run();
  write_result_files(record_of(0, 1.5), *small.problem, run, folder.path());
  ASSERT_TRUE(std::filesystem::exists(folder / "AP-overlay.png"));
  run.has_pictures = false;
  write_result_files(record_of(0, 1.5), *small.problem, run, folder.path());
  for (const std::string& name : overlay_file_names(*small.problem))
    EXPECT_FALSE(std::filesystem::exists(folder / name)) << name;
  for (const char* name : {"result.json", "pose.toml", "result.tfm", "reproduce.sh"})
    EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
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
  EXPECT_EQ(json.at("chain"), "edges");
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
  EXPECT_EQ(table.text(0, "verdict"), "doubtful");
  EXPECT_EQ(table.columns().back(), "seconds");
  EXPECT_NEAR(table.number(0, "final_rz_deg"), 30.0, 1e-9);
  EXPECT_EQ(table.text(0, "renderer"), "raycast");
}

TEST(ResultFiles, ARunOfSeveralStartsLeavesATableAndTheBestResult) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  const std::string summary =
      write_run({record_of(0, 1.0), record_of(1, 2.0)}, *small.problem, some_run(), folder.path());
  EXPECT_EQ(summary.find("verdict     doubtful: "), 0U) << summary;
  EXPECT_NE(summary.find("0 found, 2 doubtful, 0 not found"), std::string::npos) << summary;
  EXPECT_NE(summary.find("highest similarity: start 1"), std::string::npos) << summary;
  EXPECT_EQ(CsvTable::read(folder / "registrations.csv").row_count(), 2U);
  EXPECT_NE(read_text_file(folder / "result.json").find("\"start_index\": 1"), std::string::npos);
  // Verdict and probability share one sentence, and no other sentence mentions either.
  const std::string found =
      write_run({judged_record(0, 1.0, 0.995)}, *small.problem, some_run(), folder.path());
  EXPECT_EQ(found.find("verdict     found: right with 99.5 % (TRE below 2.5 mm), "), 0U) << found;
  EXPECT_NE(found.find("uncertain   if it is right, TRE below 0.50 mm"), std::string::npos);
  EXPECT_EQ(found.find("99.5 %"), found.rfind("99.5 %")) << found;
}

}  // namespace
}  // namespace af::registration
