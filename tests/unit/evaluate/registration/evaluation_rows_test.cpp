// SPDX-License-Identifier: Apache-2.0
// Rows of registrations and of image comparisons: transport, tables, statistics with known answers.
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/stored_bytes.h"
#include "evaluate/image_quality/image_quality_tables.h"
#include "evaluate/registration/case_evaluation.h"
#include "evaluate/registration/case_table.h"
#include "evaluate/registration/method_comparison.h"
#include "evaluate/registration/paired_statistics.h"
#include "evaluate/registration/pose_distances.h"
#include "evaluate/registration/registration_rows.h"
#include "evaluate/registration/registration_statistics.h"
#include "files/output_file.h"
#include "support/io_checks.h"
#include "support/test_paths.h"
#include "unit/evaluate/camera_along_z.h"

namespace af::evaluation {
namespace {

using nlohmann::json;
using Rows = std::vector<RegistrationRow>;

RegistrationRow row(const std::string& renderer,
                    std::int64_t start,
                    double initial_tre_mm,
                    double tre_mm,
                    const std::string& case_name = "skull") {
  RegistrationRow result;
  result.case_name = case_name;
  result.renderer = renderer;
  result.start_index = start;
  if (std::isfinite(initial_tre_mm)) result.interval = static_cast<int>(initial_tre_mm / 2);
  result.initial_tre_mm = initial_tre_mm;
  result.tre_mm = tre_mm;
  result.stop_reason = std::isnan(tre_mm) ? "error" : "step-below-final";
  result.seconds = renderer == "field" ? 0.2 : 40.0;
  return result;
}

TEST(RegistrationRows, TravelWithEveryBit) {
  RegistrationRow sent = row("field", 7, 3.3, std::nan(""));
  sent.draw_index = 0xFFFFFFFFFFFFFFF0u;
  sent.start_deg_mm = {0.1, -1.0 / 3, 1e-300, std::numeric_limits<double>::denorm_min(), 5, -0.0};
  sent.errors = {0.5, 1.0 / 3, 2.0, std::nan(""), 1e-300};
  sent.error = "numerics; \"failed\"\n";
  sent.chain = "far";
  sent.verdict = "doubtful";
  const RegistrationRow received =
      value_of<TracedRow>(bytes_of(TracedRow{sent, {}}), "journal").row;
  EXPECT_EQ(received.case_name, sent.case_name);
  EXPECT_EQ(received.draw_index, sent.draw_index);
  EXPECT_EQ(received.start_deg_mm, sent.start_deg_mm);
  EXPECT_TRUE(std::signbit(received.start_deg_mm[5]));
  EXPECT_TRUE(std::isnan(received.tre_mm));
  EXPECT_TRUE(std::isnan(received.final_deg_mm[0]));
  EXPECT_EQ(received.errors.projection_detector_mm, 1.0 / 3);
  EXPECT_TRUE(std::isnan(received.errors.rotation_deg));
  EXPECT_EQ(received.errors.translation_mm, 1e-300);
  EXPECT_EQ(received.error, sent.error);
  EXPECT_EQ(received.chain, "far");
  EXPECT_EQ(received.verdict, "doubtful");
  EXPECT_EQ(received.seconds, sent.seconds);
}

TEST(RegistrationRows, OfACorrectionTravelAndHaveColumnsOnlyWhereOneWasWanted) {
  RegistrationRow corrected = row("field", 7, 3.3, 1.0);
  corrected.correction = registration::CorrectionReport{2, 0.25, std::nan(""), true};
  const RegistrationRow plain = row("raycast", 7, 3.3, 1.0);
  const RegistrationRow received =
      value_of<TracedRow>(bytes_of(TracedRow{corrected, {}}), "journal").row;
  EXPECT_TRUE(received.correction.has_value());
  EXPECT_FALSE(
      value_of<TracedRow>(bytes_of(TracedRow{plain, {}}), "journal").row.correction.has_value());
  const CsvTable table = registrations_table(Rows{received, plain});
  EXPECT_EQ(table.columns().back(), "seconds");
  const std::vector<std::pair<const char*, const char*>> cells = {{"correction_casts", "2"},
                                                                  {"correction_moved_mm", "0.25"},
                                                                  {"correction_last_mm", "nan"},
                                                                  {"correction_stood_still", "1"}};
  for (const auto& [name, text] : cells) EXPECT_EQ(table.text(0, name), text) << name;
  EXPECT_EQ(table.text(1, "correction_casts"), "");
  EXPECT_EQ(table.text(1, "correction_stood_still"), "");
  const CsvTable without = registrations_table(Rows{plain});
  EXPECT_EQ(without.columns().size() + 4, table.columns().size());
}

TEST(RegistrationRows, TableHasTheContractsColumnsWithTimingsLast) {
  const CsvTable table = registrations_table(Rows{row("field", 0, 1.5, 0.3)});
  const std::vector<std::string> first(table.columns().begin(), table.columns().begin() + 20);
  EXPECT_THAT(first,
              testing::ElementsAre("case",
                                   "start_index",
                                   "renderer",
                                   "start_rx_deg",
                                   "start_ry_deg",
                                   "start_rz_deg",
                                   "start_tx_mm",
                                   "start_ty_mm",
                                   "start_tz_mm",
                                   "final_rx_deg",
                                   "final_ry_deg",
                                   "final_rz_deg",
                                   "final_tx_mm",
                                   "final_ty_mm",
                                   "final_tz_mm",
                                   "initial_tre_mm",
                                   "tre_mm",
                                   "similarity",
                                   "evaluations",
                                   "stop_reason"));
  EXPECT_EQ(table.columns().back(), "seconds");
  EXPECT_EQ(table.text(0, "success"), "1");
}

TEST(RegistrationStatistics, OfHandBuiltRowsAreTheKnownOnes) {
  const Rows rows = {row("field", 0, 0.5, 0.2),
                     row("field", 1, 1.5, 0.6),
                     row("field", 2, 2.5, 9.0),
                     row("field", 3, 3.5, std::nan("")),
                     row("raycast", 0, 0.5, 0.1)};
  const json result = renderer_statistics(rows, "field", {8, 2.0});
  EXPECT_EQ(result["starts"], 4);
  EXPECT_EQ(result["successes"], 2);
  EXPECT_EQ(result["rate"], 0.5);
  EXPECT_EQ(result["without_pose"], 1);
  EXPECT_DOUBLE_EQ(result["tre_of_successes_mm"]["mean"].get<double>(), 0.4);
  EXPECT_DOUBLE_EQ(result["tre_mm"]["median"].get<double>(), 0.6);
  EXPECT_EQ(result["tre_mm"]["count"], 3);
  EXPECT_EQ(result["intervals"][0]["successes"], 2);
  EXPECT_EQ(result["intervals"][1]["starts"], 2);
  EXPECT_EQ(result["intervals"][1]["successes"], 0);
  EXPECT_TRUE(result["intervals"][2]["rate"].is_null());
  EXPECT_EQ(result["thresholds"].back()["threshold_mm"], 10.0);
  EXPECT_EQ(result["thresholds"].back()["successes"], 3);
  EXPECT_EQ(result["stop_reasons"]["error"], 1);
  EXPECT_EQ(result["cases"].size(), 1u);
}

TEST(RegistrationStatistics, KeepEveryFailureInTheDenominatorAndNameItsReason) {
  Rows rows;
  for (std::int64_t i = 0; i < 10; ++i)
    rows.push_back(row("field", i, 0.5 + static_cast<double>(i), 0.5));
  const auto fail = [&](std::size_t i, const char* reason, double tre_mm) {
    rows[i].stop_reason = reason;
    rows[i].tre_mm = tre_mm;
  };
  fail(9, "pinned-at-limit", 4.0);
  fail(8, "start-inadmissible", std::nan(""));
  fail(7, "evaluation-budget-spent", 12.0);
  fail(6, "error", std::nan(""));
  fail(5, "step-below-final", 10.0);
  const json result = renderer_statistics(rows, "field", {4, 2.0});
  EXPECT_EQ(result["starts"], 10);
  EXPECT_EQ(result["failures_by_reason"],
            json({{"left range", 2}, {"budget", 1}, {"numerics", 1}, {"other optimum", 1}}));
  // 10.0 and 12.0 mm and the two without a pose.
  EXPECT_EQ(result["gross_failures"]["successes"], 4);
  EXPECT_EQ(result["gross_failures"]["starts"], 10);
  // Ten values, the last two infinite: 0.5 x 5, 4, 10, 12, inf, inf.
  EXPECT_EQ(result["tre_of_all_mm"]["median"], (0.5 + 4.0) / 2);
  EXPECT_EQ(result["tre_of_all_mm"]["q3"], 10.0 + 0.75 * 2.0);
  EXPECT_EQ(result["tre_of_all_mm"]["p95"], "inf");
  EXPECT_EQ(result["cumulative_capture_range"]["initial_tre_mm"], 4.5);
  EXPECT_EQ(result["cumulative_capture_range"]["starts"], 5);
  EXPECT_EQ(result["cumulative_capture_range"]["is_whole_study"], false);
  // Two starts in each interval: one of two from 4 mm on.
  const json& range = result["capture_range"];
  EXPECT_EQ(range["initial_tre_mm"], 4.0);
  EXPECT_EQ(range["starts"], 4);
  EXPECT_EQ(range["ended_by"], "failures");
  EXPECT_EQ(range["end_interval"]["low_mm"], 4.0);
  EXPECT_EQ(range["end_interval"]["successes"], 1);
  // 8.5 and 9.5 mm.
  EXPECT_EQ(result["starts_beyond_last_interval"], 2);
}

TEST(RegistrationStatistics, CountSuccessBelowTheStatedThreshold) {
  const Rows rows = {
      row("field", 0, 0.5, 0.9), row("field", 1, 1.5, 2.0), row("field", 2, 2.5, 3.0)};
  const json strict = renderer_statistics(rows, "field", {8, 2.0, 1, 1.0});
  EXPECT_EQ(strict["successes"], 1);
  EXPECT_EQ(strict["intervals"][0]["successes"], 1);
  EXPECT_EQ(strict["tre_of_successes_mm"]["mean"], 0.9);
  EXPECT_EQ(strict["cases"][0]["successes"], 1);
  EXPECT_EQ(renderer_statistics(rows, "field", {8, 2.0, 1, 5.0})["successes"], 3);
  // The ladder is the same for all: 1, 2, 2.5, 5, 10 mm.
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_EQ(strict["thresholds"][i]["successes"], (std::vector<int>{1, 1, 2, 3, 3}[i])) << i;
  EXPECT_EQ(registrations_table(rows, 1.0).text(1, "success"), "0");
  EXPECT_EQ(registrations_table(rows, 5.0).text(2, "success"), "1");
}

TEST(RegistrationStatistics, OfOneViewHaveTheLadderOfMrpd) {
  Rows rows;
  for (std::int64_t i = 0; i < 5; ++i) rows.push_back(row("field", i, 1, 30.0));
  const std::vector<double> mrpd_mm = {0.5, 1.0, 2.4, 7.0, std::nan("")};
  for (std::size_t i = 0; i < 5; ++i) rows[i].errors.mrpd_mm = mrpd_mm[i];
  const json of_two_views = renderer_statistics(rows, "field", {2, 2.0});
  EXPECT_EQ(of_two_views["error"], "TRE");
  EXPECT_EQ(of_two_views["successes"], 0);
  for (RegistrationRow& each : rows) each.has_one_view = true;
  const json result = renderer_statistics(rows, "field", {2, 2.0});
  const std::vector<int> below = {1, 2, 3, 3, 4};
  for (std::size_t i = 0; i < below.size(); ++i) {
    EXPECT_EQ(result["thresholds"][i]["successes"], below[i]) << i;
    EXPECT_EQ(result["thresholds"][i]["starts"], 5) << i;
  }
  EXPECT_EQ(result["error"], "mRPD");
  EXPECT_EQ(result["successes"], 3);
  EXPECT_EQ(result["intervals"][0]["successes"], 3);
  EXPECT_EQ(result["capture_range"]["initial_tre_mm"], 0.0);
  rows[0].has_one_view = false;
  EXPECT_EQ(renderer_statistics(rows, "field", {2, 2.0})["error"], "TRE or mRPD");
}

TEST(RegistrationStatistics, HaveCaptureRangesOfPatientsAndOverThem) {
  // Patient a succeeds to 2 mm, b to 4 mm, c everywhere (three intervals, one start each).
  Rows rows;
  const auto add = [&](const char* name, int successes) {
    for (int k = 0; k < 3; ++k)
      rows.push_back(row("field", k, 2.0 * k + 1.0, k < successes ? 0.1 : 9.0, name));
  };
  add("a", 1);
  add("b", 2);
  add("c", 3);
  const json result = renderer_statistics(rows, "field", {3, 2.0});
  EXPECT_EQ(result["cases"][0]["capture_range"]["initial_tre_mm"], 2.0);
  EXPECT_EQ(result["cases"][1]["capture_range"]["initial_tre_mm"], 4.0);
  EXPECT_EQ(result["cases"][2]["capture_range"]["ended_by"], "last interval");
  // Together 2 of 3 succeed from 2 mm on.
  EXPECT_EQ(result["capture_range"]["initial_tre_mm"], 2.0);
  const json& own = result["over_cases"]["capture_range_mm"];
  EXPECT_DOUBLE_EQ(own["mean_mm"].get<double>(), 4.0);
  EXPECT_EQ(own["min_mm"], 2.0);
  EXPECT_EQ(own["max_mm"], 6.0);
  EXPECT_EQ(own["at_least"], 1);
  EXPECT_EQ(own["cases"], 3);
  // 4 +- 4.302653 * 2 / sqrt(3), Student's quantile of two degrees of freedom.
  EXPECT_NEAR(
      own["student_high"].get<double>(), 4.0 + 4.302652729749464 * 2 / std::sqrt(3.0), 1e-9);
  EXPECT_GE(own["low"].get<double>(), 2.0);
  EXPECT_LE(own["high"].get<double>(), 6.0);
  // Drawing c three times gives 6 mm, in 1 of 27 resamples. Drawing only b and c gives at least 4
  // mm, in 8 of 27.
  const json& pooled = result["over_cases"]["pooled_capture_range_mm"];
  EXPECT_EQ(pooled["low"], 2.0);
  EXPECT_EQ(pooled["high"], 6.0);
}

TEST(RegistrationStatistics, OfOtherErrorsKeepEveryFailureToo) {
  Rows rows = {row("field", 0, 1, 0.1), row("field", 1, 1, 9.0), row("field", 2, 1, std::nan(""))};
  rows[0].errors.mrpd_mm = 0.5;
  rows[1].errors.mrpd_mm = 4.0;
  const json result = renderer_statistics(rows, "field", {8, 2.0});
  EXPECT_EQ(result["errors_of_successes"]["mrpd_mm"]["count"], 1);
  EXPECT_EQ(result["errors_of_successes"]["mrpd_mm"]["mean"], 0.5);
  EXPECT_EQ(result["errors_of_all"]["mrpd_mm"]["count"], 3);
  EXPECT_EQ(result["errors_of_all"]["mrpd_mm"]["median"], 4.0);
  EXPECT_EQ(result["errors_of_all"]["mrpd_mm"]["max"], "inf");
}

TEST(RegistrationStatistics, BiasIsTheMeanSignedErrorOfSuccesses) {
  Rows rows = {row("field", 0, 1, 0.1), row("field", 1, 1, 0.2), row("field", 2, 1, 9.0)};
  rows[0].final_deg_mm = {0.1, 0, 0, -1.0, 0, 0};
  rows[1].final_deg_mm = {0.3, 0, 0, 2.0, 0, 0};
  rows[2].final_deg_mm = {50, 50, 50, 50, 50, 50};
  const json bias = renderer_statistics(rows, "field", {8, 2.0})["bias"];
  EXPECT_DOUBLE_EQ(bias["rx_deg"]["mean"].get<double>(), 0.2);
  EXPECT_DOUBLE_EQ(bias["tx_mm"]["mean"].get<double>(), 0.5);
  EXPECT_DOUBLE_EQ(bias["tx_mm"]["sd"].get<double>(), std::sqrt(4.5));
  EXPECT_DOUBLE_EQ(bias["tx_mm"]["standard_error"].get<double>(), 1.5);
  EXPECT_EQ(bias["tz_mm"]["mean"], 0.0);
}

RegistrationRow sure_row(double tre_mm,
                         double squared_distance,
                         double confidence,
                         const std::string& case_name) {
  RegistrationRow result = row("field", 0, 4.0, tre_mm, case_name);
  result.squared_distance = squared_distance;
  result.uncertainty.tre_95_mm = 1.0;
  result.uncertainty.confidence = confidence;
  return result;
}

TEST(RegistrationStatistics, SayWhetherRegistrationsKnowTheirErrors) {
  Rows rows = {sure_row(0.5, 3.0, 0.99, "a"),
               sure_row(0.9, 12.0, 0.95, "b"),
               sure_row(1.5, 13.0, 0.6, "c"),
               sure_row(8.0, 900.0, 0.7, "c")};
  rows[0].verdict = "found";
  rows[1].verdict = rows[3].verdict = "doubtful";
  const json found = renderer_statistics(rows, "field", {1})["uncertainty"];
  EXPECT_EQ(found["pose_region_95"]["successes"], 2);
  EXPECT_EQ(found["pose_region_95"]["cases"], 3);  // failures are left to the confidence
  EXPECT_EQ(found["tre_region_95"]["successes"], 2);
  EXPECT_EQ(found["median_squared_distance"], 12.0);
  const json& confidence = found["confidence"];
  EXPECT_EQ(confidence["failures"], 1);
  EXPECT_DOUBLE_EQ(confidence["roc_area"], 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(confidence["at_least"][1]["share_of_successes"], 2.0 / 3.0);
  EXPECT_EQ(confidence["at_least"][0]["share_of_failures"], 1.0);
  // One row was not judged.
  EXPECT_EQ(found["verdicts"],
            json({{"found", {{"right", 1}, {"wrong", 0}}},
                  {"doubtful", {{"right", 1}, {"wrong", 1}}},
                  {"not found", {{"right", 0}, {"wrong", 0}}}}));
  EXPECT_FALSE(
      renderer_statistics(Rows{row("field", 0, 4.0, 0.5)}, "field", {1}).contains("uncertainty"));
}

// Ten starts of one case are one pair of X-rays; its end with the median error stands for it.
TEST(RegistrationStatistics, CountCoverageOverCases) {
  Rows rows(10, sure_row(0.5, 3.0, 0.99, "a-p1"));
  for (const double tre_mm : {0.2, 1.3, 1.2}) rows.push_back(sure_row(tre_mm, 3.0, 0.99, "b-p1"));
  json found = renderer_statistics(rows, "field", {1})["uncertainty"];
  EXPECT_EQ(found["tre_region_95"]["cases"], 2);
  EXPECT_EQ(found["tre_region_95"]["successes"], 1);
  EXPECT_FALSE(found["tre_region_95"].contains("starts"));
  EXPECT_EQ(found["tre_region_95"]["over_cases"]["cases"], 2);
  EXPECT_EQ(found["pose_region_95"]["successes"], 2);
  // The gold standard is itself up to 0.7 mm off, so 1.2 mm agree with the predicted 1 mm.
  for (RegistrationRow& of_case : rows) of_case.gold_tre_95_mm = 0.7;
  found = renderer_statistics(rows, "field", {1})["uncertainty"];
  EXPECT_EQ(found["tre_region_95"]["successes"], 2);
}

TEST(RegistrationStatistics, IntervalsOverCasesNeedSeveral) {
  Rows rows = {row("field", 0, 1, 0.2, "a"), row("field", 1, 1, 9.0, "a")};
  EXPECT_TRUE(renderer_statistics(rows, "field", {})["over_cases"]["rate"]["low"].is_null());
  rows.push_back(row("field", 0, 1, 0.4, "b"));
  const json over = renderer_statistics(rows, "field", {})["over_cases"];
  // Resamples are a and a, a and b, or b and b: rates 1/2, 2/3, 1; mean TRE 0.2, 0.3, 0.4.
  EXPECT_EQ(over["rate"]["low"], 0.5);
  EXPECT_EQ(over["rate"]["high"], 1.0);
  EXPECT_EQ(over["rate"]["cases"], 2);
  EXPECT_EQ(over["rate"]["is_optimistic"], true);
  EXPECT_DOUBLE_EQ(over["mean_error_of_successes_mm"]["low"].get<double>(), 0.2);
  EXPECT_DOUBLE_EQ(over["mean_error_of_successes_mm"]["high"].get<double>(), 0.4);
  // Student's quantile of one degree of freedom is tan(0.475 pi) = 12.7062: 0.3 +- 12.7062 * 0.1 of
  // the TRE; a rate of 0.75 +- 12.7062 * 0.25 ends at 0 and 1.
  EXPECT_NEAR(over["mean_error_of_successes_mm"]["student_high"].get<double>(), 1.57062, 1e-5);
  EXPECT_EQ(over["rate"]["student_low"], 0.0);
  EXPECT_EQ(over["rate"]["student_high"], 1.0);
}

TEST(RegistrationStatistics, OfNoRowsHaveNoRateInsteadOfAWrongOne) {
  const json result = renderer_statistics({}, "field", {});
  EXPECT_EQ(result["starts"], 0);
  EXPECT_TRUE(result["rate"].is_null());
  EXPECT_EQ(result["wilson_low"], 0.0);
  EXPECT_EQ(result["wilson_high"], 1.0);
  EXPECT_TRUE(result["capture_range"].is_null());
  EXPECT_TRUE(result["tre_of_all_mm"]["median"].is_null());
  EXPECT_TRUE(result["over_cases"]["rate"]["low"].is_null());
}

TEST(RegistrationStatistics, OfCasesThatAllSucceedHaveNoSpreadOverCases) {
  const Rows rows = {row("field", 0, 1, 0.2, "a"), row("field", 0, 1, 0.2, "b")};
  const json rate = renderer_statistics(rows, "field", {})["over_cases"]["rate"];
  EXPECT_EQ(rate["low"], 1.0);
  EXPECT_TRUE(rate["student_low"].is_null());
}

// Three true poses of one patient are not three patients, so there is no interval over patients.
TEST(RegistrationStatistics, CasesOfOnePatientAreOnePatient) {
  const Rows rows = {row("field", 0, 1, 0.2, "head-002-p1"),
                     row("field", 0, 1, 0.3, "head-002-p2"),
                     row("field", 0, 1, 9.0, "head-002-p3"),
                     row("field", 0, 1, 0.4, "spine-003-p1")};
  const json result = renderer_statistics(rows, "field", {});
  EXPECT_EQ(result["cases"].size(), 4u);
  EXPECT_EQ(result["over_cases"]["rate"]["cases"], 2);
  const json alone = renderer_statistics(Rows(rows.begin(), rows.begin() + 3), "field", {});
  EXPECT_EQ(alone["over_cases"]["rate"]["cases"], 1);
  EXPECT_TRUE(alone["over_cases"]["rate"]["low"].is_null());
  EXPECT_EQ(patient_count(std::vector<std::string>{"head-002-p1", "head-002-p2", "skull"}), 2u);
}

// One view shows no depth. An end 40 mm off along the beam is right; one 5 mm off across it is
// wrong.
TEST(RegistrationStatistics, OfOneViewAreByMrpd) {
  Rows rows = {row("field", 0, 1, 40.0), row("field", 1, 1, 5.0)};
  rows[0].errors.mrpd_mm = 0.4;
  rows[1].errors.mrpd_mm = 5.0;
  rows[0].errors.depth_mm = 39.0;
  rows[1].errors.depth_mm = 1.0;
  for (RegistrationRow& of_view : rows) {
    of_view.has_one_view = true;
    of_view.uncertainty.confidence = of_view.errors.mrpd_mm < 1.0 ? 0.99 : 0.1;
  }
  const json result = renderer_statistics(rows, "field", {});
  EXPECT_EQ(result["successes"], 1);
  EXPECT_EQ(result["gross_failures"]["successes"], 0);
  EXPECT_EQ(result["capture_range"]["initial_tre_mm"], 0.0);
  EXPECT_EQ(result["error_of_successes_mm"]["mean"], 0.4);
  EXPECT_EQ(result["error_of_all_mm"]["max"], 5.0);
  EXPECT_EQ(result["tre_of_all_mm"]["max"], 40.0);
  EXPECT_EQ(result["depth_of_successes_mm"]["median"], 39.0);
  EXPECT_EQ(result["depth_of_all_mm"]["median"], 20.0);
  EXPECT_DOUBLE_EQ(result["depth_of_all_mm"]["p95"].get<double>(), 1.0 + 0.95 * 38.0);
  const CsvTable table = registrations_table(rows);
  EXPECT_EQ(table.text(0, "success"), "1");
  EXPECT_EQ(table.text(1, "success"), "0");
  EXPECT_EQ(table.text(0, "depth_mm"), "39");
  const CsvTable cases = case_table(json::array({result}));
  EXPECT_EQ(cases.text(0, "error"), "mRPD");
  EXPECT_EQ(cases.text(0, "successes"), "1");
  EXPECT_EQ(cases.number(0, "mean_error_of_successes_mm"), 0.4);
  EXPECT_EQ(cases.number(0, "median_depth_of_all_mm"), 20.0);
  EXPECT_EQ(result["failures_by_reason"], json({{"other optimum", 1}}));
  EXPECT_EQ(result["errors_of_successes"]["mrpd_mm"]["count"], 1);
  EXPECT_EQ(result["uncertainty"]["confidence"]["failures"], 1);
  EXPECT_EQ(result["uncertainty"]["confidence"]["roc_area"], 1.0);
}

// With two views no depth is reported. With one, an end without a pose counts as infinitely deep.
TEST(RegistrationStatistics, HaveDepthOfOneViewAlone) {
  Rows rows = {row("field", 0, 1, 0.2), row("field", 1, 1, std::nan(""))};
  EXPECT_EQ(renderer_statistics(rows, "field", {})["depth_of_all_mm"]["count"], 0);
  rows[1].has_one_view = true;
  const json depth = renderer_statistics(rows, "field", {})["depth_of_all_mm"];
  EXPECT_EQ(depth["count"], 1);
  EXPECT_EQ(depth["median"], "inf");
}

TEST(Warnings, AreGivenWherePatientsAreTooFew) {
  EXPECT_THAT(warnings_about_patients(1), testing::ElementsAre(testing::HasSubstr("one patient")));
  EXPECT_THAT(warnings_about_patients(4), testing::ElementsAre(testing::HasSubstr("4 patients: ")));
  EXPECT_THAT(warnings_about_patients(30), testing::IsEmpty());
}

TEST(RowProblems, NameDuplicatesAndRowsThatContradictThemselves) {
  RegistrationRow good = row("field", 0, 1, 0.2);
  good.final_deg_mm = {};
  RegistrationRow twice = good;
  RegistrationRow without_parameters = row("field", 1, 1, 0.2);
  RegistrationRow without_initial = row("field", 2, std::nan(""), std::nan(""));
  EXPECT_THAT(row_problems(Rows{good}), testing::IsEmpty());
  EXPECT_THAT(
      row_problems(Rows{good, twice, without_parameters, without_initial}),
      testing::ElementsAre("skull, field, start 0: occurs more than once",
                           "skull, field, start 1: final pose and TRE do not belong together",
                           "skull, field, start 2: has no initial TRE"));
}

TEST(PairedStatistics, TakeOnlyStartsThatBothWereGiven) {
  const Rows rows = {row("field", 0, 0.5, 0.2),
                     row("field", 1, 1.5, 0.6),
                     row("field", 2, 2.5, 0.4),
                     row("field", 3, 2.5, 9.0),
                     row("raycast", 0, 0.5, 0.3),
                     row("raycast", 1, 1.5, 0.6),
                     row("raycast", 3, 2.5, 0.1)};
  const json result = paired_statistics(rows, {0.5});
  EXPECT_EQ(result["common_starts"], 3);
  EXPECT_EQ(result["successes"], json({2, 3}));
  EXPECT_EQ(result["median_seconds"], json({0.2, 40.0}));
  EXPECT_EQ(result["pairs"], 2);
  EXPECT_NEAR(result["mean_difference_mm"].get<double>(), -0.05, 1e-15);
  // One case says nothing about others.
  EXPECT_TRUE(result["mean_difference_over_cases_mm"]["low"].is_null());
}

/// Field ends 0.1 mm closer from the first start and fails from the last. All other registrations
/// succeed alike.
Rows paired_rows(std::int64_t starts) {
  Rows rows;
  for (std::int64_t start = 0; start < starts; ++start) {
    rows.push_back(row("field", start, 1, start == 0 ? 0.5 : start + 1 == starts ? 9.0 : 0.6));
    rows.push_back(row("raycast", start, 1, 0.6));
  }
  return rows;
}

TEST(PairedStatistics, TestNothingOnFewerThanTenPairs) {
  const json nine = paired_statistics(paired_rows(9), {0.5});
  EXPECT_TRUE(nine["mcnemar_p"].is_null());
  EXPECT_FALSE(nine.contains("test"));
  const json ten = paired_statistics(paired_rows(10), {0.5});
  // One discordant start: both of the two ways are equally probable.
  EXPECT_EQ(ten["mcnemar_p"], 1.0);
  EXPECT_FALSE(ten.contains("test")) << "nine of the ten are pairs of successes";
  const json test = paired_statistics(paired_rows(11), {0.5})["test"];
  // One difference that is not zero cannot be significant.
  EXPECT_EQ(test["signed_rank_p"], 1.0);
  EXPECT_EQ(test["margin_mm"], 0.5);
  EXPECT_GT(test["equivalence_power"].get<double>(), 0.0);
}

// Field's ends lie 30 mm deeper, which one view does not show. So both succeed alike.
TEST(PairedStatistics, OfOneViewAreByMrpd) {
  Rows rows;
  for (std::int64_t start = 0; start < 10; ++start)
    for (const char* renderer : {"field", "raycast"}) {
      rows.push_back(row(renderer, start, 1, std::string(renderer) == "field" ? 30.0 : 0.5));
      rows.back().has_one_view = true;
      rows.back().errors.mrpd_mm = 0.3;
    }
  const json result = paired_statistics(rows, {0.5});
  EXPECT_EQ(result["successes"], json({10, 10}));
  EXPECT_EQ(result["mean_difference_mm"], 0.0);
  EXPECT_EQ(result["test"]["signed_rank_p"], 1.0);
}

TEST(PairedStatistics, OverCasesResampleCases) {
  const Rows rows = {row("field", 0, 1, 0.5, "a"),
                     row("raycast", 0, 1, 0.25, "a"),
                     row("field", 0, 1, 0.5, "b"),
                     row("raycast", 0, 1, 0.75, "b")};
  const json over = paired_statistics(rows, {0.5})["mean_difference_over_cases_mm"];
  EXPECT_EQ(over["low"], -0.25);
  EXPECT_EQ(over["high"], 0.25);
  EXPECT_NEAR(over["student_high"].get<double>(), 12.7062 * 0.25, 1e-4);
}

/// Distance along x of two end poses.
double shift_between(const RegistrationRow& a, const RegistrationRow& b) {
  return std::abs(a.final_deg_mm[3] - b.final_deg_mm[3]);
}

TEST(PairedStatistics, OppositeErrorsOfEqualLengthDoNotCancelInTheDistance) {
  // Field ends 0.3 mm to one side, ray casting 0.3 mm to the other: equal TREs, 0.6 mm apart.
  Rows rows;
  for (int patient = 0; patient < 12; ++patient)
    for (std::int64_t start = 0; start < 2; ++start)
      for (const char* renderer : {"field", "raycast"}) {
        rows.push_back(row(renderer, start, 1, 0.3, "p" + std::to_string(patient)));
        const double side = std::string(renderer) == "field" ? 0.3 : -0.3;
        rows.back().final_deg_mm = {0, 0, 0, side, 0, 0};
      }
  // Both lost one start. It counts among all, but not among the pairs.
  rows[0].tre_mm = rows[1].tre_mm = 9.0;
  const json result = paired_statistics(rows, {0.5, 1, kSuccessTreMm, shift_between});
  EXPECT_EQ(result["test"]["equivalence_p"], 0.0) << "the lengths of the TREs show no difference";
  const json& ends = result["end_distance_mm"];
  EXPECT_EQ(ends["pairs"]["count"], 23);
  EXPECT_EQ(ends["all"]["count"], 24);
  EXPECT_DOUBLE_EQ(ends["over_cases"]["mean"].get<double>(), 0.6);
  EXPECT_EQ(ends["over_cases"]["cases"], 12);
  EXPECT_EQ(ends["is_equivalent"], false);
  const json wide = paired_statistics(rows, {0.7, 1, kSuccessTreMm, shift_between});
  EXPECT_EQ(wide["end_distance_mm"]["is_equivalent"], true);
}

/// Twelve patients whose ends agree where both succeed. Field loses some of the 20 starts of each.
json ends_when_field_loses(std::int64_t lost_of_first, std::int64_t lost_of_others) {
  Rows rows;
  for (int patient = 0; patient < 12; ++patient)
    for (std::int64_t start = 0; start < 20; ++start)
      for (const char* renderer : {"field", "raycast"}) {
        const bool is_field = std::string(renderer) == "field";
        const bool is_lost = is_field && start < (patient == 0 ? lost_of_first : lost_of_others);
        rows.push_back(row(renderer, start, 1, is_lost ? 9.0 : 0.3, "p" + std::to_string(patient)));
        rows.back().final_deg_mm = {0, 0, 0, is_field ? 0.01 : 0.0, 0, 0};
      }
  return paired_statistics(rows, {0.1, 1, kSuccessTreMm, shift_between})["end_distance_mm"];
}

TEST(PairedStatistics, MethodsOfOtherSuccessAreNotEquivalentWhereverBothEnd) {
  EXPECT_EQ(ends_when_field_loses(0, 0)["is_equivalent"], true);
  EXPECT_EQ(ends_when_field_loses(1, 0)["is_equivalent"], true) << "1 of 240: within 5 %";
  EXPECT_EQ(ends_when_field_loses(19, 19)["is_equivalent"], false);
  const json without = ends_when_field_loses(20, 0);
  EXPECT_EQ(without["cases_without_pairs"], 1);
  EXPECT_EQ(without["is_equivalent"], false);
}

TEST(PairedStatistics, OfFewPatientsClaimNothingHoweverManyStarts) {
  Rows rows;
  for (std::int64_t start = 0; start < 500; ++start)
    for (const char* renderer : {"field", "raycast"}) {
      rows.push_back(row(renderer, start, 1, 0.2, start % 2 == 0 ? "a" : "b"));
      rows.back().final_deg_mm = {};
    }
  const json ends =
      paired_statistics(rows, {0.1, 1, kSuccessTreMm, shift_between})["end_distance_mm"];
  EXPECT_EQ(ends["pairs"]["count"], 500);
  EXPECT_TRUE(ends["is_equivalent"].is_null());
  EXPECT_EQ(ends["has_enough_cases"], false);
  EXPECT_FALSE(paired_statistics(rows, {0.1}).contains("end_distance_mm"));
}

TEST(PairedStatistics, ManyPosesOfOnePatientClaimNothing) {
  Rows rows;
  for (int pose = 1; pose <= 20; ++pose)
    for (const char* renderer : {"field", "raycast"}) {
      rows.push_back(row(renderer, 0, 1, 0.2, "head-002-p" + std::to_string(pose)));
      rows.back().final_deg_mm = {};
    }
  const json ends =
      paired_statistics(rows, {0.1, 1, kSuccessTreMm, shift_between})["end_distance_mm"];
  EXPECT_EQ(ends["over_cases"]["cases"], 1);
  EXPECT_TRUE(ends["is_equivalent"].is_null());
}

TEST(PairedStatistics, WeighPatientsAlikeHoweverManyPairsTheyHave) {
  Rows rows;
  const auto add = [&](const char* name, std::int64_t start, double apart_mm) {
    rows.push_back(row("field", start, 1, 0.2, name));
    rows.back().final_deg_mm = {0, 0, 0, apart_mm, 0, 0};
    rows.push_back(row("raycast", start, 1, 0.2, name));
    rows.back().final_deg_mm = {};
  };
  for (std::int64_t start = 0; start < 9; ++start) add("a", start, 0.1);
  add("b", 0, 0.5);
  const json ends =
      paired_statistics(rows, {0.1, 1, kSuccessTreMm, shift_between})["end_distance_mm"];
  EXPECT_NEAR(ends["over_cases"]["mean"].get<double>(), 0.3, 1e-12);
  EXPECT_EQ(ends["pairs"]["median"], 0.1);
  EXPECT_NEAR(ends["over_cases"]["low"].get<double>(), 0.1, 1e-12);
  EXPECT_NEAR(ends["over_cases"]["high"].get<double>(), 0.5, 1e-12);
}

TEST(PairedStatistics, TieInEveryPairAtOnceIsEquivalenceWithoutSpread) {
  Rows rows;
  for (std::int64_t i = 0; i < 10; ++i) {
    rows.push_back(row("field", i, 1, 0.5));
    rows.push_back(row("raycast", i, 1, 0.5));
  }
  const json test = paired_statistics(rows, {0.1})["test"];
  EXPECT_EQ(test["t_test_p"], 1.0);
  EXPECT_EQ(test["signed_rank_p"], 1.0);
  EXPECT_EQ(test["equivalence_p"], 0.0);
}

TEST(PairedStatistics, DoNotExistWithoutCommonStarts) {
  EXPECT_TRUE(
      paired_statistics(Rows{row("field", 0, 1, 1), row("raycast", 1, 1, 1)}, {0.5}).is_null());
  // The same start number of another patient is another start.
  EXPECT_TRUE(
      paired_statistics(Rows{row("field", 0, 1, 1, "a"), row("raycast", 0, 1, 1, "b")}, {0.5})
          .is_null());
  const json one = paired_statistics(Rows{row("field", 0, 1, 1), row("raycast", 0, 1, 1)}, {0.5});
  EXPECT_EQ(one["pairs"], 1);
  EXPECT_FALSE(one.contains("test"));
}

Yardstick yardstick_at_origin() {
  Yardstick yardstick;
  yardstick.stated_pose = RigidTransform(Eigen::Translation3d(0, 0, 1));
  yardstick.points_ct_mm = {{0, 0, 0}, {10, 0, 0}};
  yardstick.rig.cameras = {test::camera_along_z()};
  return yardstick;
}

PerturbedStart start_beside(double distance_mm) {
  PerturbedStart start;
  start.draw_index = 42;
  start.room_from_ct.translation().x() = distance_mm;
  start.parameters.translation_mm.x() = distance_mm;
  start.initial_tre_mm = distance_mm;
  return start;
}

TEST(RegisteredRow, MeasuresTheEndAgainstBothPoses) {
  const RegistrationRow found = registered_row(
      [](const RigidTransform& start) {
        registration::RegistrationRecord record;
        record.result.room_from_ct = start;
        record.result.room_from_ct.translation() = Eigen::Vector3d(0, 0, 0.25);
        record.result.similarity = 1.5;
        record.result.chain = "wide-edges";
        return record;
      },
      start_beside(4.0),
      yardstick_at_origin());
  EXPECT_EQ(found.draw_index, 42u);
  EXPECT_EQ(found.initial_tre_mm, 4.0);
  EXPECT_EQ(found.start_deg_mm[3], 4.0);
  EXPECT_EQ(found.tre_mm, 0.25);
  EXPECT_EQ(found.stated_pose_tre_mm, 0.75);
  EXPECT_EQ(found.final_deg_mm[5], 0.25);
  EXPECT_EQ(found.errors.translation_mm, 0.25);
  EXPECT_EQ(found.errors.rotation_deg, 0.0);
  EXPECT_TRUE(found.has_one_view);
  EXPECT_EQ(registrations_table(Rows{found}).text(0, "chain"), "wide-edges");
  EXPECT_EQ(registrations_table(Rows{found}).text(0, "verdict"), "") << "nothing was judged";
}

TEST(RegisteredRow, OfARegistrationThatThrowsIsAFailure) {
  const RegistrationRow found = registered_row(
      [](const RigidTransform&) -> registration::RegistrationRecord {
        throw NumericError("the histogram is empty");
      },
      start_beside(1.0),
      yardstick_at_origin());
  EXPECT_EQ(found.stop_reason, "error");
  EXPECT_EQ(found.error, "the histogram is empty");
  EXPECT_TRUE(found.has_one_view) << "the case decides, not the end";
  EXPECT_TRUE(std::isnan(found.tre_mm));
  EXPECT_EQ(registrations_table(Rows{found}).text(0, "success"), "0");
}

TEST(RegisteredRow, OfAStartThatNeverMovedIsAFailureHoweverCloseItWas) {
  const RegistrationRow found = registered_row(
      [](const RigidTransform& start) {
        registration::RegistrationRecord record;
        record.result.room_from_ct = start;
        record.result.similarity = std::nan("");
        record.result.stop_reason = registration::StopReason::StartInadmissible;
        // The judge looks at the pose all the same.
        record.view_values = {{0.5, 0.5}};
        return record;
      },
      start_beside(1.0),
      yardstick_at_origin());
  EXPECT_EQ(found.stop_reason, "start-inadmissible");
  EXPECT_TRUE(std::isnan(found.tre_mm));
  EXPECT_TRUE(std::isnan(found.judge.coarse.mean));
  EXPECT_EQ(registrations_table(Rows{found}).text(0, "verdict"), "not found");
}

/// A run of one case whose gold pose turns the CT by a right angle about z.
EvaluationRun run_with_ends(const test::ScratchFolder& folder, const Rows& rows) {
  write_text_file(folder / "registrations.csv", registrations_table(rows).to_text());
  EvaluationRun run{folder.path(), {}};
  const json gold = {{0, -1, 0, 5}, {1, 0, 0, 6}, {0, 0, 1, 7}, {0, 0, 0, 1}};
  run.summary["cases"] = json::array({{{"case", "skull"},
                                       {"gold_room_from_ct", gold},
                                       {"center_ct_mm", {1, 2, 3}},
                                       {"target_box_ct_mm", {{-9, -8, -7}, {11, 12, 13}}},
                                       {"views", rows.front().has_one_view ? 1 : 2}}});
  run.summary["provenance"]["input_sha256"] = {{"skull: xray A", "aa"}, {"skull: xray B", "bb"}};
  run.summary["success_tre_mm"] = kSuccessTreMm;
  run.summary["method"] = {{"preset", "fast"}, {"similarity", "gc"}, {"optimizer", "gradient"}};
  run.summary["renderers"] = json::array({renderer_statistics(rows, "field", {8, 2.0})});
  return run;
}

TEST(MethodComparison, OfAHandBuiltRunIsTheKnownOne) {
  const test::ScratchFolder folder;
  Rows rows = {row("field", 0, 1, 0.2),
               row("field", 1, 7, 0.4),
               row("field", 2, 8, 9.0),
               row("field", 3, 29, std::nan("")),
               row("field", 4, 31, 0.3)};
  rows[0].final_deg_mm = {0.3, 0, 0, 0, 1, 0};
  rows[1].final_deg_mm = {0, 0.6, 0, 0, 2, 0};
  rows[4].final_deg_mm = {0, 0, 0, 0, 3, 0};
  for (RegistrationRow& each : rows) each.drr_count = 100 + each.start_index;
  const CsvTable table = methods_table({run_with_ends(folder, rows)});
  ASSERT_EQ(table.row_count(), 1u);
  EXPECT_EQ(table.text(0, "method"), "fast gc gradient");
  EXPECT_EQ(table.text(0, "optimizer"), "gradient");
  EXPECT_EQ(table.text(0, "starts"), "5");
  EXPECT_EQ(table.text(0, "successes_0_8_mm"), "2");
  EXPECT_EQ(table.text(0, "starts_0_8_mm"), "2");
  EXPECT_EQ(table.text(0, "successes_8_16_mm"), "0");
  EXPECT_EQ(table.text(0, "starts_8_16_mm"), "1");   // 8 mm belongs to the band that begins there
  EXPECT_EQ(table.text(0, "starts_16_30_mm"), "1");  // 31 mm lies beyond all
  EXPECT_DOUBLE_EQ(table.number(0, "mean_error_mm"), 0.3);
  EXPECT_DOUBLE_EQ(table.number(0, "median_error_mm"), 0.3);
  EXPECT_DOUBLE_EQ(table.number(0, "translation_bias_mm"), 2.0);
  EXPECT_DOUBLE_EQ(table.number(0, "rotation_bias_deg"), std::hypot(0.1, 0.2));
  EXPECT_EQ(table.number(0, "median_drr_count"), 102.0);
  EXPECT_EQ(table.number(0, "median_seconds"), 0.2);
  EXPECT_EQ(table.text(0, "gross_failures"), "1");  // the one without a pose
  // Wilson's interval of 2 of 2 begins at 2 / (2 + 1.96^2).
  EXPECT_NEAR(table.number(0, "wilson_low_0_8_mm"), 0.34, 5e-3);
  EXPECT_EQ(table.text(0, "error"), "TRE");
  EXPECT_EQ(table.text(0, "median_depth_mm"), "nan");
}

TEST(MethodComparison, OfOneViewIsByMrpdWithDepthBesideIt) {
  const test::ScratchFolder folder;
  Rows rows = {row("field", 0, 1, 30.0), row("field", 1, 1, 40.0), row("field", 2, 1, 5.0)};
  const std::vector<double> mrpd_mm = {0.2, 0.6, 4.0};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].has_one_view = true;
    rows[i].errors.mrpd_mm = mrpd_mm[i];
    rows[i].errors.depth_mm = rows[i].tre_mm;
    rows[i].final_deg_mm = {};
  }
  const CsvTable table = methods_table({run_with_ends(folder, rows)});
  EXPECT_EQ(table.text(0, "error"), "mRPD");
  EXPECT_EQ(table.text(0, "successes_0_8_mm"), "2");
  EXPECT_EQ(table.text(0, "gross_failures"), "0");
  EXPECT_DOUBLE_EQ(table.number(0, "median_error_mm"), 0.4);
  EXPECT_DOUBLE_EQ(table.number(0, "median_depth_mm"), 35.0);
  EXPECT_DOUBLE_EQ(table.number(0, "p95_depth_mm"), 39.5);
}

TEST(MethodComparison, TakesThresholdTargetAndCaptureRangeFromTheSummary) {
  const test::ScratchFolder folder;
  Rows rows = {row("field", 0, 1, 1.5), row("field", 1, 1, 0.5)};
  rows[0].start_deg_mm = {0, 0, 0, 0, 1, 0};  // a translation
  rows[1].start_deg_mm = {1, 0, 0, 0, 0, 0};  // a rotation
  for (RegistrationRow& each : rows) each.final_deg_mm = {};
  EvaluationRun run = run_with_ends(folder, rows);
  run.summary["success_tre_mm"] = 1.0;
  run.summary["cases"][0]["center_ct_mm"] = {0, 0, 0};
  run.summary["cases"][0]["target_box_ct_mm"] = {{-9, -9, -9}, {9, 9, 9}};
  run.summary["renderers"] = json::array({renderer_statistics(rows, "field", {8, 2.0, 1, 1.0})});
  const CsvTable table = methods_table({run});
  EXPECT_EQ(table.text(0, "successes_0_8_mm"), "1");
  EXPECT_EQ(table.number(0, "rotation_share_0_8_mm"), 0.5);
  EXPECT_EQ(table.text(0, "capture_range_mm"), "0");
  EXPECT_EQ(table.text(0, "gross_failures"), "0");
}

TEST(PoseDistances, OfTwoRunsAreThoseOfTheirEndsFromTheSameStarts) {
  const test::ScratchFolder a;
  const test::ScratchFolder b;
  Rows first = {row("field", 0, 1, 0.2),
                row("field", 1, 1, 0.2),
                row("field", 2, 1, 0.2),
                row("field", 3, 1, std::nan(""))};
  for (RegistrationRow& each : first)
    if (each.start_index < 3) each.final_deg_mm = {1, 2, 3, 4, 5, 6};
  Rows second = first;
  // Translations: the distance is their length, for every point of the box.
  second[0].final_deg_mm = {1, 2, 3, 4 + 0.3, 5, 6 - 0.4};
  second[1].final_deg_mm = {1, 2, 3, 4, 5 + 0.1, 6};
  // As read back from the other run's starts.csv.
  first[1].start_deg_mm[0] = 0.9193596395490815;
  second[1].start_deg_mm[0] = 0.9193596395490825;
  second[2].start_deg_mm[0] = 1.0;  // another start
  const std::vector<PoseDistanceRow> found =
      pose_distances({run_with_ends(a, first), run_with_ends(b, second)});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].case_name, "skull");
  EXPECT_EQ(found[0].distance_mm.count, 2u);
  // Sums of coordinates of some 10 mm in double precision.
  constexpr double kRounding = 1e-12;
  EXPECT_NEAR(found[0].distance_mm.median, 0.3, kRounding);
  EXPECT_NEAR(found[0].distance_mm.maximum, 0.5, kRounding);
  EXPECT_EQ(pose_distances_table(found).text(0, "starts"), "2");
}

/// Field against `renderer_b`, on one case.
PoseDistanceRow distances_of(const std::string& case_name,
                             const std::vector<double>& distances_mm,
                             const std::string& renderer_b = "raycast") {
  return {case_name, "a", "field", "b", renderer_b, summarize(distances_mm), {}};
}

TEST(PoseDistances, OverPatientsTakeTheirMeansAlike) {
  std::vector<PoseDistanceRow> rows;
  for (int patient = 0; patient < 10; ++patient)
    // The first patient has more starts than the others, and no more weight.
    rows.push_back(distances_of("p" + std::to_string(patient),
                                std::vector<double>(patient == 0 ? 50 : 1, 0.01 * patient),
                                "field"));
  rows.push_back(distances_of("p0", {0.3}));
  const std::vector<PatientDistances> found = distances_over_patients(rows, 0.1);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].starts, 59u);
  EXPECT_EQ(found[0].equivalence.cases, 10u);
  EXPECT_NEAR(found[0].equivalence.mean, 0.045, 1e-12);
  EXPECT_TRUE(found[0].equivalence.is_shown());
  const CsvTable table = patient_distances_table(found);
  EXPECT_EQ(table.text(0, "claim"), "yes");
  EXPECT_EQ(table.text(1, "claim"), "too few patients");
  EXPECT_EQ(table.text(1, "p"), "fewer than 10 patients");
  EXPECT_LT(table.number(0, "p"), 0.05);
  EXPECT_EQ(table.text(1, "patients"), "1");
  EXPECT_EQ(distances_over_patients(rows, 0.05)[0].equivalence.is_shown(), false);
}

TEST(PoseDistances, CountAPatientOnceHoweverManyRunsHaveIt) {
  std::vector<PoseDistanceRow> rows;
  // Two repeats, whose folders have the same names, give four rows for the pair of methods.
  for (int patient = 0; patient < 6; ++patient)
    for (const double distance_mm : {0.01, 0.02, 0.03, 0.04})
      rows.push_back(distances_of("p" + std::to_string(patient), {distance_mm}));
  const std::vector<PatientDistances> found = distances_over_patients(rows, 0.1);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].equivalence.cases, 6u);
  EXPECT_NEAR(found[0].equivalence.mean, 0.025, 1e-12);
}

TEST(PoseDistances, CountAPatientOnceAtHoweverManyPoses) {
  std::vector<PoseDistanceRow> rows;
  for (int patient = 1; patient <= 4; ++patient)
    for (int pose = 1; pose <= 3; ++pose)
      rows.push_back(distances_of(
          "spine-00" + std::to_string(patient) + "-p" + std::to_string(pose), {0.01 * pose}));
  const std::vector<PatientDistances> found = distances_over_patients(rows, 0.1);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].starts, 12u);
  EXPECT_EQ(found[0].equivalence.cases, 4u);
  EXPECT_NEAR(found[0].equivalence.mean, 0.02, 1e-12);
  EXPECT_FALSE(found[0].equivalence.has_enough_cases());
}

TEST(PoseDistances, OfARotationDependOnWhereTheBoxIs) {
  const test::ScratchFolder a;
  const test::ScratchFolder b;
  Rows first = {row("field", 0, 1, 0.2)};
  first[0].final_deg_mm = {0, 0, 0, 0, 0, 0};
  Rows second = first;
  second[0].final_deg_mm = {0, 0, 1, 0, 0, 0};
  EvaluationRun far = run_with_ends(a, first);
  // A box of 2 mm about a point 100 mm from the centre along the CT's x: chords of 100 mm.
  far.summary["cases"][0]["target_box_ct_mm"] = {{100, 1, 2}, {102, 3, 4}};
  const std::vector<PoseDistanceRow> found = pose_distances({far, run_with_ends(b, second)});
  EXPECT_NEAR(found.at(0).distance_mm.median, 200 * std::sin(0.5 * kRadPerDeg), 1e-3);
  EXPECT_NEAR(found.at(0).rotation_deg.median, 1.0, 1e-9);
  const CsvTable table = pose_distances_table(found);
  for (const char* const column : {"mean", "median", "p95", "max"})
    EXPECT_NEAR(table.number(0, std::string(column) + "_rotation_deg"), 1.0, 1e-6) << column;
}

TEST(PoseDistances, RefuseRunsOfDifferentXrays) {
  const test::ScratchFolder a;
  const test::ScratchFolder b;
  Rows rows = {row("field", 0, 1, 0.2)};
  rows[0].final_deg_mm = {};
  const EvaluationRun first = run_with_ends(a, rows);
  EvaluationRun second = run_with_ends(b, rows);
  EXPECT_EQ(pose_distances({first, second}).size(), 1u);
  json& hashes = second.summary["provenance"]["input_sha256"];
  const auto refusal = [&] {
    return test::message_of<InputError>([&] { pose_distances({first, second}); });
  };
  hashes["skull: xray B"] = "other";
  EXPECT_THAT(refusal(),
              testing::AllOf(testing::HasSubstr(a.path().filename().string()),
                             testing::HasSubstr(b.path().filename().string()),
                             testing::HasSubstr("case skull, view B")));
  hashes.erase("skull: xray B");
  EXPECT_THAT(refusal(), testing::HasSubstr("case skull, view B"));
  // A run of another program's poses may lack the X-rays, and then states no hashes.
  hashes = json::object();
  EXPECT_EQ(pose_distances({first, second}).size(), 1u);
}

TEST(PoseDistances, OfARunThatStatesNoTargetAreAFileError) {
  const test::ScratchFolder folder;
  EvaluationRun run = run_with_ends(folder, {row("field", 0, 1, 0.2)});
  run.summary["cases"][0].erase("center_ct_mm");
  EXPECT_THROW(pose_distances({run}), FileError);
  run.summary["cases"] = json::array();
  EXPECT_THROW(pose_distances({run}), FileError);
}

TEST(MethodComparison, OfARunWithoutSuccessHasNoErrors) {
  const test::ScratchFolder folder;
  const CsvTable table = methods_table({run_with_ends(folder, {row("field", 0, 1, 5.0)})});
  EXPECT_EQ(table.text(0, "mean_error_mm"), "nan");
}

TEST(MethodComparison, OfASummaryThatLacksAFactIsAFileError) {
  const test::ScratchFolder folder;
  const EvaluationRun whole = run_with_ends(folder, {row("field", 0, 1, 0.2)});
  for (const char* key : {"success_tre_mm", "cases", "method", "renderers"}) {
    EvaluationRun run = whole;
    run.summary.erase(key);
    EXPECT_THROW(methods_table({run}), FileError) << key;
  }
}

TEST(MethodComparison, PairsAreThoseOfTheSummary) {
  Rows rows;
  for (const auto& [field_mm, raycast_mm] :
       std::vector<std::pair<double, double>>{{0.2, 0.1}, {0.4, 0.3}, {0.3, 5.0}}) {
    const auto start = static_cast<std::int64_t>(rows.size() / 2);
    rows.push_back(row("field", start, 1, field_mm));
    rows.push_back(row("raycast", start, 1, raycast_mm));
  }
  EvaluationRun run{"runs/skull-fast", {}};
  // End poses 0.25 mm apart, but of one patient: nothing is claimed.
  for (RegistrationRow& each : rows) each.final_deg_mm = {};
  for (std::size_t i = 0; i < rows.size(); i += 2) rows[i].final_deg_mm[3] = 0.25;
  run.summary["field_against_raycast"] =
      paired_statistics(rows, {0.5, 1, kSuccessTreMm, shift_between});
  const CsvTable table = pairs_table({run});
  ASSERT_EQ(table.row_count(), 1u);
  EXPECT_EQ(table.text(0, "run"), "skull-fast");
  EXPECT_EQ(table.number(0, "common_starts"), 3.0);
  EXPECT_EQ(table.number(0, "successes_raycast"), 2.0);
  EXPECT_EQ(table.number(0, "mean_distance_mm"), 0.25);
  EXPECT_EQ(table.text(0, "claim"), "not claimed: fewer than 10 patients");
  EXPECT_EQ(table.text(0, "p"), "fewer than 10 patients");
  EXPECT_EQ(table.text(0, "mcnemar_p"), "fewer than 10 pairs");
  EXPECT_NEAR(table.number(0, "error_difference_mm"), 0.1, 1e-12);
  run.summary["field_against_raycast"] = nullptr;
  EXPECT_EQ(pairs_table({run}).row_count(), 0u);
}

std::vector<DrrComparison> comparisons(const std::vector<double>& psnr_db) {
  std::vector<DrrComparison> result;
  for (const double value : psnr_db) {
    DrrComparison comparison;
    comparison.psnr_db = value;
    comparison.redrawn = 1;
    result.push_back(comparison);
  }
  return result;
}

TEST(ImageQualityStatistics, OfHandBuiltComparisonsAreTheKnownOnes) {
  const json result = image_quality_statistics(comparisons({35.0, 40.0, 41.0, 42.0, std::nan("")}));
  EXPECT_EQ(result["poses"], 5);
  EXPECT_EQ(result["compared"], 4);
  EXPECT_EQ(result["outside_or_empty"], 1);
  EXPECT_EQ(result["redrawn"], 5);
  EXPECT_EQ(result["psnr_db"]["median"], 40.5);
  EXPECT_EQ(result["psnr_db"]["min"], 35.0);
  EXPECT_EQ(result["share_above_40_db"], 0.5);  // 40 itself is not above
  EXPECT_EQ(result["share_below_36_db"], 0.25);
}

TEST(ImageQualityStatistics, FindTheWorstAndTheMedianPair) {
  const auto found = comparisons({43.0, std::nan(""), 35.0, 41.0});
  EXPECT_EQ(comparison_at(found, 0.0), 2u);
  EXPECT_EQ(comparison_at(found, 0.5), 3u);
  EXPECT_EQ(comparison_at(comparisons({std::nan("")}), 0.0), std::nullopt);
}

TEST(ImageQualityRows, TravelWithEveryBit) {
  DrrComparison sent;
  sent.parameters = PoseParameters::from_deg_and_mm({1, 2, 3, 4, 5, 1.0 / 3});
  sent.psnr_db = std::numeric_limits<double>::infinity();
  sent.rays_outside = 12;
  const DrrComparison received = value_of<DrrComparison>(bytes_of(sent), "journal");
  EXPECT_EQ(received.parameters.rotation_rad, sent.parameters.rotation_rad);
  EXPECT_EQ(received.parameters.translation_mm, sent.parameters.translation_mm);
  EXPECT_TRUE(std::isinf(received.psnr_db));
  EXPECT_TRUE(std::isnan(received.reference_maximum));
  EXPECT_EQ(received.rays_outside, 12);
}

}  // namespace
}  // namespace af::evaluation
