// SPDX-License-Identifier: Apache-2.0
// Success of many patients, each the unit that is sampled.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "evaluate/statistics/bootstrap.h"
#include "evaluate/statistics/success_rate.h"

namespace af::evaluation {

/// How starts and ends are counted.
struct PopulationCounting {
  int intervals = 15;
  double interval_width_mm = 2.0;
  double success_mm = kSuccessTreMm;
  std::uint64_t seed = 1;
};

/// The registrations of one patient in one condition: all true poses together.
struct PatientOutcomes {
  std::string patient;
  std::vector<TreOutcome> outcomes;  ///< ends by RegistrationRow::decisive_mm()
  std::vector<double> depth_mm;      ///< errors of successes of one view
  std::vector<double> seconds;

  /// The number at the end of the patient's name; 0: none, such as that of a real CT.
  [[nodiscard]] int number() const;
  /// What stands before the number: the kind of patient, or the whole name.
  [[nodiscard]] std::string kind() const;
};

/// "odd" (the half to tune on), "even" (the half to judge on) or "real".
std::string half_of(const PatientOutcomes& patient);

/// One patient's success.
struct PatientSuccess {
  std::string patient;
  std::int64_t starts = 0;
  std::int64_t successes = 0;
  ProportionInterval wilson;
  /// Without an interval: two or three starts per interval of initial TRE hardly tell success rates
  /// apart, so that what a patient's own starts leave plausible begins at 0.
  CaptureRange capture;
};

/// Success of a group of patients. \test PopulationStatistics.OfHandMadePatients
struct PopulationSuccess {
  std::vector<PatientSuccess> patients;
  std::int64_t starts = 0;
  std::int64_t successes = 0;
  std::array<std::int64_t, kLadderMm.size()> below_ladder = {};  ///< ends below each threshold
  /// How many lost a start. Of a rate near 1 it says more than the rate's intervals, which are too
  /// narrow where few patients lose many.
  std::int64_t patients_with_failures = 0;
  ProportionInterval share_with_failures;  ///< Wilson's, of such patients
  MeanOverCases rate;        ///< of all starts; every patient has its own number of them
  MeanOverCases capture_mm;  ///< mean of the patients' own capture ranges
  std::int64_t capture_lower_bounds = 0;   ///< patients whose range is at least the whole study's
  CaptureRange pooled;                     ///< of all starts together
  CaseBootstrap pooled_interval_mm;        ///< of the pooled range, by resampling of patients
  std::vector<IntervalSuccess> intervals;  ///< of all starts together
  std::vector<CaseBootstrap> interval_bootstraps;
};

PopulationSuccess population_success(const std::vector<const PatientOutcomes*>& patients,
                                     const PopulationCounting& counting);

}  // namespace af::evaluation
