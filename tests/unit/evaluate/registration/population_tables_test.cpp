// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/population_tables.h"

#include <gtest/gtest.h>

namespace af::evaluation {
namespace {

constexpr PopulationCounting kTwoIntervals{2, 2.0, 2.5, 1};

/// Patients 1 to 3 of a kind, each with two starts in each of two intervals; the last patient's
/// starts beyond 2 mm fail.
PopulationCondition three_patients(const std::string& name) {
  PopulationCondition condition{name, {}, {"mRPD"}};
  for (int number = 1; number <= 3; ++number) {
    PatientOutcomes patient;
    patient.patient = "spine-00" + std::to_string(number);
    for (const double initial_mm : {0.5, 1.5, 2.5, 3.5}) {
      const bool fails = number == 3 && initial_mm > 2.0;
      patient.outcomes.push_back({initial_mm, fails ? 9.0 : 0.1});
      if (!fails) patient.depth_mm.push_back(10.0 * number);
      patient.seconds.push_back(0.5);
    }
    condition.patients.push_back(patient);
  }
  return condition;
}

TEST(PopulationTables, CountAllPatientsTheHalvesAndTheKinds) {
  const auto groups = groups_of(three_patients("clean-2-robust"), kTwoIntervals);
  const CsvTable table = population_table(groups, kTwoIntervals.success_mm);
  ASSERT_EQ(table.row_count(), 4u);
  EXPECT_EQ(table.text(0, "group"), "all");
  EXPECT_EQ(table.number(0, "starts"), 12.0);
  EXPECT_EQ(table.number(0, "successes"), 10.0);
  EXPECT_EQ(table.text(0, "error"), "mRPD");
  EXPECT_EQ(table.number(0, "median_error_mm"), 0.1);
  // Four of 10 mm, four of 20, two of 30.
  EXPECT_EQ(table.number(0, "median_depth_mm"), 20.0);
  EXPECT_EQ(table.number(0, "p95_depth_mm"), 30.0);
  EXPECT_EQ(table.number(0, "worst_patient_rate"), 0.5);
  EXPECT_EQ(table.number(0, "patients_with_failures"), 1.0);
  // Wilson (1927) for 1 of 3.
  EXPECT_NEAR(table.number(0, "share_with_failures_low"), 0.0615, 5e-5);
  EXPECT_NEAR(table.number(0, "share_with_failures_high"), 0.7923, 5e-5);
  EXPECT_EQ(table.number(0, "below_1_mm"), 10.0);
  EXPECT_EQ(table.number(0, "below_5_mm"), 10.0);
  EXPECT_EQ(table.number(0, "below_10_mm"), 12.0);
  EXPECT_EQ(table.number(0, "success_mm"), kTwoIntervals.success_mm);
  EXPECT_EQ(table.text(1, "group"), "odd");
  EXPECT_EQ(table.number(1, "successes"), 6.0);
  EXPECT_EQ(table.text(2, "group"), "even");
  EXPECT_EQ(table.number(2, "successes"), 4.0);
  EXPECT_EQ(table.text(3, "group"), "spine");
  const CsvTable patients = patients_table(groups);
  ASSERT_EQ(patients.row_count(), 3u);
  EXPECT_EQ(patients.number(2, "successes"), 2.0);
  EXPECT_EQ(patients.text(2, "error"), "mRPD");
  const CsvTable intervals = intervals_table(groups);
  ASSERT_EQ(intervals.row_count(), 2u);
  EXPECT_EQ(intervals.number(1, "successes"), 4.0);
  EXPECT_EQ(intervals.number(1, "starts"), 6.0);
}

}  // namespace
}  // namespace af::evaluation
