// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/population_statistics.h"

#include <cmath>

#include <gtest/gtest.h>

#include "evaluate/statistics/patient_names.h"

namespace af::evaluation {
namespace {

/// Four starts in each of five intervals of 2 mm; those from `fails_from_mm` on fail.
PatientOutcomes patient(const std::string& name, double fails_from_mm) {
  PatientOutcomes outcomes;
  outcomes.patient = name;
  for (int i = 0; i < 20; ++i) {
    const double initial_mm = 0.5 * i + 0.1;
    outcomes.outcomes.push_back({initial_mm, initial_mm < fails_from_mm ? 0.3 : 8.0});
    outcomes.seconds.push_back(0.1);
  }
  return outcomes;
}

constexpr PopulationCounting kCounting{5, 2.0, 2.5, 1};

TEST(PopulationStatistics, TakesPatientsFromNamesOfCases) {
  EXPECT_EQ(patient_of_case("spine-001-p3"), "spine-001");
  EXPECT_EQ(patient_of_case("skull-p12"), "skull");
  EXPECT_EQ(patient_of_case("skull"), "skull");
  EXPECT_EQ(patient_of_case("p3"), "p3");
  EXPECT_EQ(half_of(patient("spine-007", 0)), "odd");
  EXPECT_EQ(half_of(patient("spine-010", 0)), "even");
  EXPECT_EQ(half_of(patient("skull", 0)), "real");
  EXPECT_EQ(half_of(patient("skull2", 0)), "real");
  EXPECT_EQ(patient("spine-007", 0).kind(), "spine");
  EXPECT_EQ(patient("skull", 0).kind(), "skull");
}

TEST(PopulationStatistics, OfHandMadePatients) {
  const PatientOutcomes good = patient("a-001", 100.0);
  const PatientOutcomes half = patient("a-002", 4.0);
  const PopulationSuccess success = population_success({&good, &half}, kCounting);
  EXPECT_EQ(success.starts, 40);
  EXPECT_EQ(success.successes, 28);
  EXPECT_DOUBLE_EQ(success.rate.value, 0.7);
  EXPECT_EQ(success.patients[0].capture.initial_tre_mm, 10.0);
  EXPECT_EQ(success.patients[1].capture.initial_tre_mm, 4.0);
  EXPECT_DOUBLE_EQ(success.capture_mm.value, 7.0);
  // The third interval has half of its starts: the range of all starts ends before it.
  EXPECT_EQ(success.pooled.initial_tre_mm, 4.0);
  // Two patients: each replicate has one twice or both.
  EXPECT_DOUBLE_EQ(success.rate.bootstrap.low, 0.4);
  EXPECT_DOUBLE_EQ(success.rate.bootstrap.high, 1.0);
  EXPECT_DOUBLE_EQ(success.pooled_interval_mm.low, 4.0);
  EXPECT_DOUBLE_EQ(success.pooled_interval_mm.high, 10.0);
  // Student's interval with one degree of freedom: 0.7 +- 12.706 * 0.3.
  EXPECT_NEAR(success.rate.student.high, 0.7 + 12.706 * 0.3, 1e-3);
  EXPECT_EQ(success.capture_lower_bounds, 1);
}

TEST(PopulationStatistics, IntervalsOverPatientsAreWiderThanOverStarts) {
  // Ten patients of 20 starts that succeed or fail together: 0.5 +- 0.31, where Wilson's interval
  // of 200 independent starts would be 0.5 +- 0.07.
  std::vector<PatientOutcomes> patients;
  std::vector<const PatientOutcomes*> all;
  for (int i = 0; i < 10; ++i)
    patients.push_back(patient("a-" + std::to_string(i), i % 2 == 0 ? 100.0 : 0.0));
  for (const PatientOutcomes& one : patients) all.push_back(&one);
  const PopulationSuccess success = population_success(all, kCounting);
  EXPECT_GT(success.rate.bootstrap.high - success.rate.bootstrap.low, 0.4);
  EXPECT_LT(wilson_interval(100, 200).high - wilson_interval(100, 200).low, 0.15);
}

}  // namespace
}  // namespace af::evaluation
