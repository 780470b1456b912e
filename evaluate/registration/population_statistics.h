// SPDX-License-Identifier: Apache-2.0
// Success over many patients. The patient is the unit that is sampled.
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
  std::vector<double> depth_mm;      ///< errors of successes with one view
  std::vector<double> seconds;

  /// The number at the end of the patient's name, or 0 when there is none, as for a real CT.
  [[nodiscard]] int number() const;
  /// What precedes the number: the kind of patient, or the whole name.
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
  /// Has no interval. Two or three starts per interval of initial TRE hardly tell success rates
  /// apart, so the range that a patient's own starts leave plausible would begin at 0.
  CaptureRange capture;
};

/// Success of a group of patients. \test PopulationStatistics.OfHandMadePatients
struct PopulationSuccess {
  std::vector<PatientSuccess> patients;
  std::int64_t starts = 0;
  std::int64_t successes = 0;
  std::array<std::int64_t, kLadderMm.size()> below_ladder = {};  ///< ends below each threshold
  /// How many patients lost a start. At a rate near 1 this says more than the rate's intervals,
  /// which are too narrow where few patients lose many.
  std::int64_t patients_with_failures = 0;
  ProportionInterval share_with_failures;  ///< Wilson's interval of the share of such patients
  MeanOverCases rate;        ///< over all starts; patients have different numbers of them
  MeanOverCases capture_mm;  ///< mean of the patients' own capture ranges
  std::int64_t capture_lower_bounds = 0;   ///< patients whose range ends only with the study's
  CaptureRange pooled;                     ///< over all starts together
  CaseBootstrap pooled_interval_mm;        ///< of the pooled range, by resampling patients
  std::vector<IntervalSuccess> intervals;  ///< over all starts together
  std::vector<CaseBootstrap> interval_bootstraps;
};

PopulationSuccess population_success(const std::vector<const PatientOutcomes*>& patients,
                                     const PopulationCounting& counting);

}  // namespace af::evaluation
