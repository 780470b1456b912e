// SPDX-License-Identifier: Apache-2.0
// Rows of registrations and of image comparisons: transport, tables, statistics with known answers.
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "evaluate/case_evaluation_program.h"
#include "evaluate/image_quality_files.h"
#include "evaluate/registration_rows_files.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

RegistrationRow row(const std::string& renderer,
                    std::int64_t start,
                    double initial_tre_mm,
                    double tre_mm,
                    const std::string& case_name = "skull") {
  RegistrationRow result;
  result.case_name = case_name;
  result.renderer = renderer;
  result.start_index = start;
  result.interval = static_cast<int>(initial_tre_mm / 2);
  result.initial_tre_mm = initial_tre_mm;
  result.tre_mm = tre_mm;
  result.stop_reason = std::isnan(tre_mm) ? "error" : "step-below-final";
  result.seconds = renderer == "field" ? 0.2 : 40.0;
  return result;
}

json through_cbor(const json& value) {
  return json::from_cbor(json::to_cbor(value));
}

TEST(RegistrationRows, TravelWithEveryBit) {
  RegistrationRow sent = row("field", 7, 3.3, std::nan(""));
  sent.draw_index = 0xFFFFFFFFFFFFFFF0u;
  sent.start_deg_mm = {0.1, -1.0 / 3, 1e-300, std::numeric_limits<double>::denorm_min(), 5, -0.0};
  sent.error = "numerics; \"failed\"\n";
  const RegistrationRow received = row_of(through_cbor(packed_row(3, sent)));
  EXPECT_EQ(received.case_name, sent.case_name);
  EXPECT_EQ(received.draw_index, sent.draw_index);
  EXPECT_EQ(received.start_deg_mm, sent.start_deg_mm);
  EXPECT_TRUE(std::signbit(received.start_deg_mm[5]));
  EXPECT_TRUE(std::isnan(received.tre_mm));
  EXPECT_TRUE(std::isnan(received.final_deg_mm[0]));
  EXPECT_EQ(received.error, sent.error);
  EXPECT_EQ(received.seconds, sent.seconds);
}

TEST(RegistrationRows, TableHasTheContractsColumnsWithTimingsLast) {
  const CsvTable table = registrations_table({row("field", 0, 1.5, 0.3)});
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
  const std::vector<RegistrationRow> rows = {row("field", 0, 0.5, 0.2),
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

TEST(PairedStatistics, TakeOnlyStartsThatBothWereGiven) {
  const std::vector<RegistrationRow> rows = {row("field", 0, 0.5, 0.2),
                                             row("field", 1, 1.5, 0.6),
                                             row("field", 2, 2.5, 0.4),
                                             row("field", 3, 2.5, 9.0),
                                             row("raycast", 0, 0.5, 0.3),
                                             row("raycast", 1, 1.5, 0.6),
                                             row("raycast", 3, 2.5, 0.1)};
  const json result = paired_statistics(rows, 0.5);
  EXPECT_EQ(result["common_starts"], 3);
  EXPECT_EQ(result["successes"], json({2, 3}));
  EXPECT_EQ(result["median_seconds"], json({0.2, 40.0}));
  EXPECT_EQ(result["pairs"], 2);
  EXPECT_NEAR(result["test"]["mean_difference_mm"].get<double>(), -0.05, 1e-15);
}

TEST(PairedStatistics, DoNotExistWithoutCommonStarts) {
  EXPECT_TRUE(paired_statistics({row("field", 0, 1, 1), row("raycast", 1, 1, 1)}, 0.5).is_null());
  // The same start number of another patient is another start.
  EXPECT_TRUE(
      paired_statistics({row("field", 0, 1, 1, "a"), row("raycast", 0, 1, 1, "b")}, 0.5).is_null());
  const json one = paired_statistics({row("field", 0, 1, 1), row("raycast", 0, 1, 1)}, 0.5);
  EXPECT_EQ(one["pairs"], 1);
  EXPECT_FALSE(one.contains("test"));
}

Yardstick yardstick_at_origin() {
  Yardstick yardstick;
  yardstick.stated_pose = RigidTransform(Eigen::Translation3d(0, 0, 1));
  yardstick.points_ct_mm = {{0, 0, 0}, {10, 0, 0}};
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
        registration::RegistrationResult result;
        result.room_from_ct = start;
        result.room_from_ct.translation() = Eigen::Vector3d(0, 0, 0.25);
        result.similarity = 1.5;
        return result;
      },
      start_beside(4.0),
      yardstick_at_origin());
  EXPECT_EQ(found.draw_index, 42u);
  EXPECT_EQ(found.initial_tre_mm, 4.0);
  EXPECT_EQ(found.start_deg_mm[3], 4.0);
  EXPECT_EQ(found.tre_mm, 0.25);
  EXPECT_EQ(found.stated_pose_tre_mm, 0.75);
  EXPECT_EQ(found.final_deg_mm[5], 0.25);
}

TEST(RegisteredRow, OfARegistrationThatThrowsIsAFailure) {
  const RegistrationRow found = registered_row(
      [](const RigidTransform&) -> registration::RegistrationResult {
        throw NumericError("the histogram is empty");
      },
      start_beside(1.0),
      yardstick_at_origin());
  EXPECT_EQ(found.stop_reason, "error");
  EXPECT_EQ(found.error, "the histogram is empty");
  EXPECT_TRUE(std::isnan(found.tre_mm));
  EXPECT_EQ(registrations_table({found}).text(0, "success"), "0");
}

TEST(RegisteredRow, OfAStartThatNeverMovedIsAFailureHoweverCloseItWas) {
  const RegistrationRow found = registered_row(
      [](const RigidTransform& start) {
        registration::RegistrationResult result;
        result.room_from_ct = start;
        result.similarity = std::nan("");
        result.stop_reason = registration::StopReason::StartInadmissible;
        return result;
      },
      start_beside(1.0),
      yardstick_at_origin());
  EXPECT_EQ(found.stop_reason, "start-inadmissible");
  EXPECT_TRUE(std::isnan(found.tre_mm));
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
  const DrrComparison received = comparison_of(through_cbor(comparison_row(5, sent)));
  EXPECT_EQ(received.parameters.rotation_rad, sent.parameters.rotation_rad);
  EXPECT_EQ(received.parameters.translation_mm, sent.parameters.translation_mm);
  EXPECT_TRUE(std::isinf(received.psnr_db));
  EXPECT_TRUE(std::isnan(received.reference_maximum));
  EXPECT_EQ(received.rays_outside, 12);
}

}  // namespace
}  // namespace af::evaluation
