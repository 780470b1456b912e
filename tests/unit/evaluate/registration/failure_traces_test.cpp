// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/failure_traces.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace af::evaluation {
namespace {

/// Gold at the origin; the search's own frame 10 mm beside it along x.
Yardstick some_yardstick() {
  Yardstick yardstick;
  yardstick.gold_frame = PoseFrame::about(RigidTransform::Identity(), Eigen::Vector3d::Zero());
  yardstick.points_ct_mm = {{0, 0, 0}, {5, 0, 0}, {0, 7, 0}};
  return yardstick;
}

PoseFrame shifted_frame() {
  RigidTransform shift = RigidTransform::Identity();
  shift.translation().x() = 10.0;
  return PoseFrame::about(shift, Eigen::Vector3d::Zero());
}

registration::TraceRow trace_row(int evaluations, double ty_mm) {
  registration::TraceRow row;
  row.pass = 1;
  row.step_mm = 2.0;
  row.evaluations = evaluations;
  row.similarity = 0.25;
  row.parameters.translation_mm.y() = ty_mm;
  return row;
}

TEST(FailureTraces, AreSeenFromTheGoldPose) {
  const auto points = trace_points({trace_row(13, 0.0)}, shifted_frame(), some_yardstick());
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].stage, 2);
  EXPECT_EQ(points[0].poses_tried, 13);
  EXPECT_DOUBLE_EQ(points[0].deg_mm[3], 10.0);
  EXPECT_DOUBLE_EQ(points[0].tre_mm, 10.0);
}

TEST(FailureTraces, OfLongSearchesKeepBothEndsAndAStatedNumberOfSteps) {
  std::vector<registration::TraceRow> trace;
  for (int i = 0; i < 5000; ++i) trace.push_back(trace_row(i, 0.0));
  const auto points = trace_points(trace, shifted_frame(), some_yardstick());
  ASSERT_EQ(points.size(), kMostTracePoints);
  EXPECT_EQ(points.front().poses_tried, 0);
  EXPECT_EQ(points.back().poses_tried, 4999);
  EXPECT_TRUE(trace_points({}, shifted_frame(), some_yardstick()).empty());
}

TEST(FailureTraces, AreKeptOfTheFirstFailuresOfAMethodOnly) {
  FirstTraces kept;
  const auto count = static_cast<std::int64_t>(kMostTraces);
  for (std::int64_t start = 3 * count; start-- > 0;)  // the first come last
    keep_if_first(start, {{1, 2.0, start, 0.5, {}, 9.0}}, kept);
  keep_if_first(1, {}, kept);
  keep_if_first(count, {{1, 2.0, 0, 0.5, {}, 9.0}}, kept);
  ASSERT_EQ(kept.size(), kMostTraces);
  EXPECT_EQ(kept.rbegin()->first, count - 1);
  EXPECT_EQ(kept.at(1).front().poses_tried, 1);
}

TEST(FailureTraces, AreNamedAfterCaseMethodAndStart) {
  EXPECT_EQ(trace_file("skull 01/a", "field", 12), "traces/skull_01_a-field-12.csv");
  const CsvTable table = trace_table({{2, 0.5, 40, 1.25, {1, 2, 3, 4, 5, 6}, 7.5}});
  EXPECT_THAT(table.to_text(),
              testing::StartsWith("stage,step_mm,poses_tried,similarity,"
                                  "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm,tre_mm\n2,0.5,40,"));
  EXPECT_EQ(table.number(0, "tz_mm"), 6.0);
  EXPECT_EQ(table.number(0, "tre_mm"), 7.5);
}

}  // namespace
}  // namespace af::evaluation
