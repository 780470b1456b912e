// SPDX-License-Identifier: Apache-2.0
// What runs over several patients and fields compute from their rows.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "evaluate/registration/case_table.h"
#include "evaluate/registration/join_studies.h"
#include "evaluate/registration/registration_rows.h"
#include "evaluate/sweeps/difference_images.h"
#include "study/rig_file.h"
#include "support/io_checks.h"
#include "support/test_paths.h"

namespace af::evaluation {
namespace {

using nlohmann::json;
using testing::HasSubstr;

SettingResult result_of(const std::string& camera, int uv_nodes, const std::vector<double>& psnr) {
  SettingResult result;
  result.setting.camera = camera;
  result.setting.uv_nodes = uv_nodes;
  for (const double value : psnr) {
    DrrComparison comparison;
    comparison.psnr_db = value;
    result.comparisons.push_back(comparison);
  }
  return result;
}

TEST(DifferenceImages, AreThoseNearestToTheLevelsAtOnePose) {
  // Pose 1 of camera B is off by 0.1, 0.2 and 0.3 dB; every other pose by more.
  const std::vector<SettingResult> results = {result_of("A", 16, {30.0, 36.0}),
                                              result_of("A", 32, {40.0, 39.0}),
                                              result_of("A", 64, {44.0, 50.0}),
                                              result_of("B", 16, {20.0, 40.2}),
                                              result_of("B", 32, {21.0, 36.1}),
                                              result_of("B", 64, {std::nan(""), 43.7})};
  const std::vector<SweepDrr> drrs = drrs_at_levels(results, {36.0, 40.0, 44.0});
  ASSERT_EQ(drrs.size(), 3u);
  const std::vector<std::size_t> expected = {4, 3, 5};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(drrs[i].result, expected[i]);
    EXPECT_EQ(drrs[i].pose, 1u);
  }
  EXPECT_TRUE(drrs_at_levels({result_of("A", 16, {std::nan("")})}, {36.0}).empty());
}

Study study_of(const std::string& case_name) {
  Study study;
  study.path = "/studies/" + case_name + "/study.toml";
  study.rig = read_rig("treatment-room");
  study.rig_name_or_path = "treatment-room";
  StudyCase study_case;
  study_case.name = case_name;
  for (const char* camera : {"A", "B"}) {
    StudyView view;
    view.camera = camera;
    study_case.views.push_back(view);
  }
  study.cases.push_back(study_case);
  return study;
}

TEST(JoinedStudy, HasAllCasesAndTheirFields) {
  const Study joined = joined_study(
      {study_of("spine"), study_of("head")}, "fields/{case}-{camera}.af.h5", "/studies/study.toml");
  ASSERT_EQ(joined.cases.size(), 2u);
  EXPECT_EQ(joined.cases[1].name, "head");
  EXPECT_EQ(joined.cases[1].views[1].field, "/studies/fields/head-B.af.h5");
  const Study plain = joined_study({study_of("spine")}, "", "study.toml");
  EXPECT_FALSE(plain.cases[0].views[0].field.has_value());
}

TEST(JoinedStudy, RefusesOtherCamerasAndEqualNames) {
  EXPECT_THAT(test::message_of<InputError>([] {
                joined_study({study_of("spine"), study_of("spine")}, "", "study.toml");
              }),
              HasSubstr("name = spine"));
  Study other = study_of("head");
  other.rig = read_rig("c-arm-12in");
  EXPECT_THAT(test::message_of<InputError>([&] {
                joined_study({study_of("spine"), other}, "", "study.toml");
              }),
              HasSubstr("same cameras"));
}

TEST(CaseTable, HasARowPerCaseAndOneOverAll) {
  const auto part = [](int starts, int successes, const json& mean) {
    return json{{"starts", starts},
                {"successes", successes},
                {"rate", static_cast<double>(successes) / starts},
                {"error", "TRE"},
                {"error_of_successes_mm", {{"mean", mean}, {"sd", 0.25}}},
                {"error_of_all_mm", {{"median", 0.5}, {"p95", "inf"}}},
                {"tre_of_all_mm", {{"median", 0.5}, {"p95", "inf"}}},
                {"depth_of_all_mm", {{"median", nullptr}, {"p95", nullptr}}},
                {"gross_failures", {{"successes", starts - successes}}},
                {"capture_range", nullptr}};
  };
  json renderer = part(6, 2, 0.5);
  renderer["renderer"] = "field";
  renderer["cases"] = {part(2, 2, 0.5), part(4, 0, nullptr)};
  renderer["cases"][0]["case"] = "head";
  renderer["cases"][1]["case"] = "spine";
  renderer["cases"][1]["capture_range"] = {{"initial_tre_mm", 8.0}, {"ended_by", "failures"}};
  const CsvTable table = case_table(json::array({renderer}));
  ASSERT_EQ(table.row_count(), 3u);
  EXPECT_EQ(table.text(0, "case"), "head");
  EXPECT_EQ(table.text(0, "mean_error_of_successes_mm"), "0.5");
  EXPECT_EQ(table.text(1, "mean_error_of_successes_mm"), "nan");
  EXPECT_EQ(table.text(0, "median_depth_of_all_mm"), "nan");
  EXPECT_EQ(table.text(1, "p95_error_of_all_mm"), "inf");
  EXPECT_EQ(table.text(1, "p95_tre_of_all_mm"), "inf");
  EXPECT_EQ(table.text(2, "case"), "all");
  EXPECT_EQ(table.text(2, "successes"), "2");
  EXPECT_EQ(table.text(2, "gross_failures"), "4");
  EXPECT_EQ(table.text(0, "capture_range_mm"), "nan");
  EXPECT_EQ(table.text(0, "capture_range_ended_by"), "");
  EXPECT_EQ(table.text(1, "capture_range_mm"), "8");
  EXPECT_EQ(table.text(1, "capture_range_ended_by"), "failures");
}

TEST(StartsFile, HasEveryStartOfEveryCaseWhateverTheirNumber) {
  const test::ScratchFolder folder;
  std::vector<PerturbedStart> few(3);
  std::vector<PerturbedStart> many(9000);
  for (std::size_t i = 0; i < many.size(); ++i) many[i].draw_index = 2 * i;
  StartsFile file(folder / "starts.csv");
  file.add("few", few);
  file.add("many", many);
  EXPECT_FALSE(std::filesystem::exists(folder / "starts.csv"));
  file.finish();
  const CsvTable table = CsvTable::read(folder / "starts.csv");
  ASSERT_EQ(table.row_count(), few.size() + many.size());
  EXPECT_EQ(table.text(2, "case"), "few");
  EXPECT_EQ(table.text(3, "case"), "many");
  for (std::size_t i = 0; i < many.size(); ++i) {
    ASSERT_EQ(table.text(3 + i, "start_index"), std::to_string(i));
    ASSERT_EQ(table.text(3 + i, "draw_index"), std::to_string(2 * i));
  }
}

}  // namespace
}  // namespace af::evaluation
