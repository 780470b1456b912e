// SPDX-License-Identifier: Apache-2.0
// Runs the real program on result sets whose errors are set by hand. It must give the known
// statistics (to the last bit where they are counts), and report everything that is wrong with a
// set.
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/csv_table.h"
#include "files/output_file.h"
#include "study/rig_file.h"
#include "study/study_file.h"
#include "support/run_program.h"
#include "support/test_paths.h"

namespace af {
namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// The gold pose of every case: a quarter turn and a shift by whole millimetres. A pose that is
/// shifted from it by a multiple of a power of two then has exactly that TRE.
RigidTransform gold_pose() {
  RigidTransform pose = RigidTransform::Identity();
  pose.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  pose.translation() = Eigen::Vector3d(12, -7, 5);
  return pose;
}

/// A pose whose TRE is `tre_mm` exactly, as the columns m00 to m23.
std::string pose_text(double tre_mm) {
  const RigidTransform gold = gold_pose();
  std::string text;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      text +=
          "," + number_text(gold.matrix()(row, column) + (row == 0 && column == 3 ? tre_mm : 0.0));
  return text;
}

constexpr const char* kPoseColumns = ",m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n";

/// One case by hand: initial and final TREs of its starts. A final nullopt means that the row is
/// missing.
struct HandBuiltCase {
  std::string name;
  std::vector<double> initial_tre_mm;
  std::vector<std::optional<double>> tre_mm;
};

/// Twenty starts from 0.25 mm on, 0.75 mm apart: 3, 2, 3, 3, 2, 3, 3, 1 in intervals of 2 mm.
std::vector<double> twenty_starts() {
  std::vector<double> initial_mm;
  for (int i = 0; i < 20; ++i) initial_mm.push_back(0.25 + 0.75 * i);
  return initial_mm;
}

/// Mixed results with ties, at thresholds too; all succeed; all fail; one start.
std::vector<HandBuiltCase> four_cases() {
  return {{"mixed", twenty_starts(), {0.25, 0.25, 0.5,  0.5,  0.75, 0.75,        1.0,
                                      1.0,  1.5,  1.75, 2.0,  2.25, 2.5,         4.0,
                                      5.0,  8.0,  10.0, 16.0, kNan, std::nullopt}},
          {"perfect", twenty_starts(), std::vector<std::optional<double>>(20, 0.5)},
          {"hopeless", twenty_starts(), std::vector<std::optional<double>>(20, std::nullopt)},
          {"single", {3.0}, {0.125}}};
}

class HandBuiltResults : public testing::Test {
 protected:
  /// study.toml whose CT and X-rays do not exist, starts.csv and poses.csv.
  void SetUp() override {
    Study study;
    study.path = path("study.toml");
    study.rig_name_or_path = "treatment-room";
    study.rig = read_rig(study.rig_name_or_path);
    std::string starts = std::string("case,start_index") + kPoseColumns;
    poses_ = starts;
    for (const HandBuiltCase& built : four_cases()) {
      add_case(built.name, study);
      for (std::size_t i = 0; i < built.tre_mm.size(); ++i) {
        const std::string key = built.name + "," + std::to_string(i);
        starts += key + pose_text(built.initial_tre_mm[i]) + "\n";
        if (built.tre_mm[i].has_value()) poses_ += key + pose_text(*built.tre_mm[i]) + "\n";
      }
    }
    write_text_file(study.path, study_to_toml(study, folder_.path()));
    write_text_file(path("starts.csv"), starts);
  }

  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_ / name).string();
  }

  /// Runs the program on poses.csv.
  test::ProgramRun evaluate(const std::string& more = "") {
    write_text_file(path("poses.csv"), poses_);
    std::filesystem::remove_all(path("out"));
    return test::run_command(std::string(AF_PROGRAM_FOLDER "/af-evaluate registration --study ") +
                             path("study.toml") + " --starts-from " + path("starts.csv") +
                             " --poses-from " + path("poses.csv") +
                             " --method-name theirs --no-pictures -o " + path("out") + " " + more);
  }
  [[nodiscard]] json summary() const {
    return json::parse(read_text_file(path("out/summary.json")));
  }
  [[nodiscard]] json statistics() const { return summary()["renderers"][0]; }
  static json of_case(const json& statistics, const std::string& name) {
    for (const json& entry : statistics["cases"])
      if (entry["case"] == name) return entry;
    return nullptr;
  }

  std::string poses_;

 private:
  void add_case(const std::string& name, Study& study) const {
    StudyCase study_case;
    study_case.name = name;
    study_case.ct = path("absent-ct.nii.gz");
    study_case.target_box_ct = {{-10, -10, -10}, {10, 10, 10}};
    study_case.gold_room_from_ct = gold_pose();
    for (const CameraGeometry& camera : study.rig.cameras) {
      StudyView view;
      view.camera = camera.name;
      view.xray = path("absent-" + camera.name + ".mha");
      view.roi = {100, 100, 200, 200};
      study_case.views.push_back(view);
    }
    study.cases.push_back(study_case);
  }

  test::ScratchFolder folder_;
};

TEST_F(HandBuiltResults, HaveExactlyTheKnownStatistics) {
  const test::ProgramRun run = evaluate();
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const json all = statistics();
  EXPECT_EQ(all["starts"], 61);
  EXPECT_EQ(all["successes"], 12 + 20 + 0 + 1);
  EXPECT_EQ(all["rate"], 33.0 / 61.0);
  // By Wilson's formula, worked out separately.
  EXPECT_NEAR(all["wilson_low"].get<double>(), 0.41724048130756475, 1e-12);
  EXPECT_NEAR(all["wilson_high"].get<double>(), 0.6598706770614424, 1e-12);
  EXPECT_EQ(all["without_pose"], 2 + 20);
  EXPECT_EQ(all["failures_by_reason"], json({{"no pose given", 22}, {"other optimum", 6}}));
  // Starts by interval of 2 mm: of three cases with 20 starts, and of one with a start at 3 mm.
  const std::vector<int> starts = {9, 7, 9, 9, 6, 9, 9, 3};
  const std::vector<int> successes = {6, 5, 6, 6, 3, 3, 3, 1};
  for (std::size_t i = 0; i < starts.size(); ++i) {
    EXPECT_EQ(all["intervals"][i]["starts"], starts[i]) << i;
    EXPECT_EQ(all["intervals"][i]["successes"], successes[i]) << i;
  }
  EXPECT_EQ(all["starts_beyond_last_interval"], 0);
}

TEST_F(HandBuiltResults, OfAMixedCaseAreKnownToTheLastBit) {
  ASSERT_EQ(evaluate().exit_code, 0);
  const json mixed = of_case(statistics(), "mixed");
  // Ties with a threshold are not below it.
  const std::vector<int> below = {6, 10, 12, 14, 16};
  for (std::size_t i = 0; i < below.size(); ++i)
    EXPECT_EQ(mixed["thresholds"][i]["successes"], below[i]) << i;
  EXPECT_EQ(mixed["gross_failures"]["successes"], 4);  // 10, 16, NaN and the missing one
  // Positions 9.5, 4.75, 14.25 and 18.05 of twenty, the last two infinite.
  EXPECT_EQ(mixed["tre_of_all_mm"]["median"], (1.75 + 2.0) / 2);
  EXPECT_EQ(mixed["tre_of_all_mm"]["q1"], 0.75);
  EXPECT_EQ(mixed["tre_of_all_mm"]["q3"], 5.0 + 0.25 * 3.0);
  EXPECT_EQ(mixed["tre_of_all_mm"]["p95"], "inf");
  EXPECT_DOUBLE_EQ(mixed["tre_of_successes_mm"]["mean"].get<double>(), 12.5 / 12.0);
  // The first twelve succeed; with the thirteenth 12 / 13 is below 95 %.
  EXPECT_EQ(mixed["cumulative_capture_range"]["initial_tre_mm"], 0.25 + 0.75 * 11);
  EXPECT_EQ(mixed["cumulative_capture_range"]["starts"], 12);
  EXPECT_EQ(mixed["cumulative_capture_range"]["is_whole_study"], false);
  // Starts lie at 0.25 + 0.75 i mm. Start 12, the first to fail, lies at 9.25 mm, in the interval
  // from 8 mm.
  EXPECT_EQ(mixed["capture_range"]["initial_tre_mm"], 8.0);
  EXPECT_EQ(mixed["capture_range"]["starts"], 11);
  EXPECT_EQ(mixed["capture_range"]["end_interval"]["low_mm"], 8.0);
  // A pure shift has no rotation error, and its translation error is the whole TRE.
  const CsvTable rows = CsvTable::read(path("out/registrations.csv"));
  EXPECT_EQ(rows.text(20, "case"), "mixed");
  EXPECT_EQ(rows.number(20, "tre_mm"), 0.25);
  EXPECT_EQ(rows.number(20, "translation_error_mm"), 0.25);
  EXPECT_EQ(rows.number(20, "rotation_error_deg"), 0.0);
}

TEST_F(HandBuiltResults, OfOneStartOfAllFailuresAndOfAllSuccessesAreTheEndsOfTheFormulas) {
  ASSERT_EQ(evaluate().exit_code, 0);
  const json all = statistics();
  const json perfect = of_case(all, "perfect");
  EXPECT_EQ(perfect["wilson_high"], 1.0);
  EXPECT_NEAR(perfect["wilson_low"].get<double>(), 0.8388748419471806, 1e-12);
  EXPECT_EQ(perfect["capture_range"]["is_whole_study"], true);
  EXPECT_EQ(perfect["tre_of_successes_mm"]["sd"], 0.0);
  const json hopeless = of_case(all, "hopeless");
  EXPECT_EQ(hopeless["rate"], 0.0);
  EXPECT_EQ(hopeless["wilson_low"], 0.0);
  EXPECT_NEAR(hopeless["wilson_high"].get<double>(), 0.16112515805281938, 1e-12);
  EXPECT_TRUE(hopeless["tre_of_successes_mm"]["mean"].is_null());
  EXPECT_TRUE(hopeless["cumulative_capture_range"].is_null());
  EXPECT_EQ(hopeless["capture_range"]["initial_tre_mm"], 0.0);
  EXPECT_EQ(hopeless["capture_range"]["is_whole_study"], false);
  EXPECT_EQ(hopeless["tre_of_all_mm"]["median"], "inf");
  const json single = of_case(all, "single");
  EXPECT_NEAR(single["wilson_low"].get<double>(), 0.20654931437723745, 1e-12);
  EXPECT_EQ(single["wilson_high"], 1.0);
  EXPECT_TRUE(single["tre_of_successes_mm"]["sd"].is_null());
}

TEST_F(HandBuiltResults, SayHowTheStartsWereDrawnAsFarAsTheyKnow) {
  ASSERT_EQ(evaluate().exit_code, 0);
  const CsvTable starts = CsvTable::read(path("out/starts-per-interval.csv"));
  ASSERT_EQ(starts.row_count(), 4u * 8u);
  // The starts were given, so the number of refused draws is unknown. They are pure shifts.
  EXPECT_EQ(starts.text(0, "draws"), "nan");
  EXPECT_EQ(starts.text(0, "refused_draws"), "nan");
  EXPECT_NEAR(starts.number(0, "rotation_share_of_starts"), 0.0, 1e-9);
  EXPECT_EQ(starts.number(1, "high_mm"), 4.0);
  const CsvTable cases = CsvTable::read(path("out/cases.csv"));
  EXPECT_EQ(cases.text(0, "case"), "hopeless");
  EXPECT_EQ(cases.number(0, "gross_failures"), 20.0);
  EXPECT_EQ(cases.number(0, "capture_range_mm"), 0.0);
  EXPECT_EQ(cases.text(0, "capture_range_ended_by"), "failures");
}

TEST_F(HandBuiltResults, AreCountedBelowTheStatedThreshold) {
  ASSERT_EQ(evaluate("--success-tre-mm 1").exit_code, 0);
  EXPECT_EQ(summary()["success_tre_mm"], 1.0);
  EXPECT_EQ(of_case(statistics(), "mixed")["successes"], 6);
  EXPECT_EQ(evaluate("--success-tre-mm 0").exit_code, 3);
  EXPECT_EQ(evaluate("--success-tre-mm nan").exit_code, 2);
}

TEST_F(HandBuiltResults, OfFewCasesComeWithAWarning) {
  const test::ProgramRun run = evaluate();
  EXPECT_THAT(run.output,
              HasSubstr("4 patients: the bootstrap interval over patients is too narrow"));
  const json over = statistics()["over_cases"]["rate"];
  EXPECT_EQ(over["cases"], 4);
  EXPECT_EQ(over["is_optimistic"], true);
  // The rates 0.6, 1, 0 and 1 have the mean 0.65 and the SD 0.4725816. Student's 3.182446 at three
  // degrees of freedom reaches beyond both ends.
  EXPECT_EQ(over["student_low"], 0.0);
  EXPECT_EQ(over["student_high"], 1.0);
  EXPECT_EQ(summary()["warnings"].size(), 1u);

  const test::ProgramRun one = evaluate("--case single");
  ASSERT_EQ(one.exit_code, 0) << one.output;
  EXPECT_THAT(one.output, HasSubstr("1 of 1 starts succeeded"));
  EXPECT_THAT(one.output, HasSubstr("one patient: "));
  EXPECT_TRUE(statistics()["over_cases"]["rate"]["low"].is_null());
  const test::ProgramRun none = evaluate("--case hopeless");
  ASSERT_EQ(none.exit_code, 0) << none.output;
  EXPECT_THAT(none.output, HasSubstr("0 of 20 starts succeeded"));
  EXPECT_THAT(none.output, testing::Not(HasSubstr("nan")));
}

TEST_F(HandBuiltResults, ReportWhatIsMissingTwiceNotFiniteOrOfNobody) {
  ASSERT_EQ(evaluate().exit_code, 0);
  const json expected = statistics();
  EXPECT_EQ(summary()["row_problems"].size(), 3u);  // the NaN, its start, all starts of `hopeless`
  const std::size_t lines = 2 + 19 + 20 + 1;
  // None of these may change a number.
  poses_ += "mixed,3" + pose_text(0.0) + "\n";    // a second, better pose
  poses_ += "mixed,18" + pose_text(0.0) + "\n";   // a pose after the NaN
  poses_ += "mixed,20" + pose_text(0.5) + "\n";   // no such start
  poses_ += "mixed,0.5" + pose_text(0.5) + "\n";  // no start at all
  poses_ += "mixed," + pose_text(0.5) + "\n";
  poses_ += "mixde,19" + pose_text(0.5) + "\n";  // no such case
  const test::ProgramRun run = evaluate();
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_EQ(statistics(), expected);
  const std::string file = path("poses.csv");
  const auto where = [&](std::size_t after) { return file + ":" + std::to_string(lines + after); };
  EXPECT_THAT(summary()["row_problems"].get<std::vector<std::string>>(),
              testing::UnorderedElementsAre(
                  file + ":20: the pose of start 18 has values that are not finite",
                  "mixed: no pose for starts 18 to 19",
                  "hopeless: no pose for starts 0 to 19",
                  where(0) + ": start 3 occurs again; the first row counts",
                  where(1) + ": start 18 occurs again; the first row counts",
                  "mixed: a pose for start 20, which does not exist",
                  where(3) + ": start_index '0.5' is not a whole number; left out",
                  where(4) + ": start_index '' is not a whole number; left out",
                  file + ": 1 poses of case 'mixde', which the study does not have; left out"));
  const json problems = summary()["row_problems"];
  for (const json& problem : problems)
    EXPECT_THAT(run.output, HasSubstr(problem.get<std::string>()));
}

TEST_F(HandBuiltResults, AreRefusedWhenTheStartsThemselvesAreAmbiguous) {
  const std::string starts = read_text_file(path("starts.csv"));
  const auto line_of_start_1 = starts.find("mixed,1,");
  const auto line_of_start_2 = starts.find("mixed,2,");
  // Without start 1, every later start would have another number.
  write_text_file(path("starts.csv"),
                  starts.substr(0, line_of_start_1) + starts.substr(line_of_start_2));
  const test::ProgramRun run = evaluate();
  EXPECT_EQ(run.exit_code, 3) << run.output;
  EXPECT_THAT(run.output, HasSubstr("start_index"));
  EXPECT_THAT(run.output, HasSubstr("starts.csv:3"));
}

TEST_F(HandBuiltResults, InAChainGiveTheKnownErrorBudget) {
  const auto budget = [&](const std::string& first, const std::string& second) {
    return test::run_command(
        std::string(AF_PROGRAM_FOLDER "/af-evaluate error-budget --step 'as it "
                                      "was=") +
        path(first) + "' --step 'moved=" + path(second) + "' -o " + path("budget"));
  };
  ASSERT_EQ(evaluate("--case perfect").exit_code, 0);
  std::filesystem::rename(path("out"), path("first"));
  // Moves every end of the case 0.25 mm farther along the same axis.
  const std::string before = pose_text(0.5);
  const std::string after = pose_text(0.75);
  for (auto at = poses_.find(before); at != std::string::npos;
       at = poses_.find(before, at + after.size()))
    poses_.replace(at, before.size(), after);
  ASSERT_EQ(evaluate("--case perfect").exit_code, 0);
  const test::ProgramRun run = budget("first", "out");
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output,
              HasSubstr("| moved | 20 of 20 | 0.250 +- 0.000 | 0.750 | 0.000 | 0.750 |"));
  const json steps = json::parse(read_text_file(path("budget/summary.json")))["steps"];
  // Final parameters are written in degrees and read back, which rounds poses of 1 mm.
  EXPECT_NEAR(steps[1]["shift_mm"].get<double>(), 0.25, 1e-12);
  EXPECT_NEAR(steps[0]["bias_mm"].get<double>(), 0.5, 1e-12);
  // The report has it, too.
  ASSERT_EQ(test::run_command(std::string(AF_PROGRAM_FOLDER "/af-evaluate report ") +
                              path("budget") + " -o " + path("budget.html"))
                .exit_code,
            0);
  EXPECT_NE(read_text_file(path("budget.html")).find("Error budget"), std::string::npos);

  ASSERT_EQ(evaluate("--case mixed").exit_code, 0);
  const test::ProgramRun refused = budget("first", "out");
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.output, HasSubstr("must be from the same starts"));
}

TEST_F(HandBuiltResults, GiveAReportAlsoWhenNothingSucceeded) {
  ASSERT_EQ(evaluate("--case hopeless").exit_code, 0);
  const test::ProgramRun run =
      test::run_command(std::string(AF_PROGRAM_FOLDER "/af-evaluate report ") + path("out") +
                        " -o " + path("report.html"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const std::string page = read_text_file(path("report.html"));
  EXPECT_NE(page.find("no pose for starts 0 to 19"), std::string::npos);
  EXPECT_NE(page.find("The starts were given by a table"), std::string::npos);
  EXPECT_EQ(page.find(">nan"), std::string::npos);
}

}  // namespace
}  // namespace af
