// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/population_statistics.h"

#include <span>
#include <utility>

#include "evaluate/statistics/patient_names.h"

namespace af::evaluation {

namespace {

std::vector<IntervalSuccess> intervals_of(const std::vector<TreOutcome>& outcomes,
                                          const PopulationCounting& counting) {
  return success_per_interval(
      outcomes, counting.intervals, counting.interval_width_mm, counting.success_mm);
}

/// Pools all starts, interval by interval, and again for patients that are drawn anew.
void pool_intervals(const std::vector<std::vector<IntervalSuccess>>& own,
                    const PopulationCounting& counting,
                    PopulationSuccess& result) {
  result.pooled = capture_range(result.intervals);
  result.pooled_interval_mm = bootstrap_over_cases(
      own.size(),
      [&](std::span<const std::size_t> drawn) {
        return capture_range(pooled_intervals(own, drawn)).initial_tre_mm;
      },
      counting.seed);
  for (std::size_t k = 0; k < result.intervals.size(); ++k) {
    std::vector<CaseMean> rates;
    for (const std::vector<IntervalSuccess>& patient : own)
      rates.push_back(
          {static_cast<double>(patient[k].successes), static_cast<double>(patient[k].trials)});
    result.interval_bootstraps.push_back(mean_over_cases(rates, counting.seed).bootstrap);
  }
}

}  // namespace

int PatientOutcomes::number() const {
  const std::size_t digits = digits_at_end(patient);
  constexpr std::size_t kMostDigits = 9;
  if (digits == 0 || digits > kMostDigits || digits == patient.size() ||
      patient[patient.size() - digits - 1] != '-')
    return 0;
  return std::stoi(patient.substr(patient.size() - digits));
}

std::string PatientOutcomes::kind() const {
  return number() == 0 ? patient : patient.substr(0, patient.size() - digits_at_end(patient) - 1);
}

std::string half_of(const PatientOutcomes& patient) {
  const int number = patient.number();
  if (number == 0) return "real";
  return number % 2 == 1 ? "odd" : "even";
}

PopulationSuccess population_success(const std::vector<const PatientOutcomes*>& patients,
                                     const PopulationCounting& counting) {
  PopulationSuccess result;
  std::vector<std::vector<IntervalSuccess>> own;  // one list per patient
  std::vector<TreOutcome> all;
  std::vector<CaseMean> rates;
  std::vector<CaseMean> ranges_mm;
  for (const PatientOutcomes* patient : patients) {
    const std::vector<TreOutcome>& outcomes = patient->outcomes;
    own.push_back(intervals_of(outcomes, counting));
    all.insert(all.end(), outcomes.begin(), outcomes.end());
    PatientSuccess success;
    success.patient = patient->patient;
    success.starts = static_cast<std::int64_t>(outcomes.size());
    success.successes = count_successes(outcomes, counting.success_mm);
    success.wilson = wilson_interval(success.successes, success.starts);
    success.capture = capture_range(own.back());
    result.capture_lower_bounds += success.capture.is_whole_study() ? 1 : 0;
    result.starts += success.starts;
    result.successes += success.successes;
    result.patients_with_failures += success.successes < success.starts ? 1 : 0;
    rates.push_back({static_cast<double>(success.successes), static_cast<double>(success.starts)});
    ranges_mm.push_back({success.capture.initial_tre_mm, 1.0});
    result.patients.push_back(std::move(success));
  }
  for (std::size_t i = 0; i < kLadderMm.size(); ++i)
    result.below_ladder[i] = count_successes(all, kLadderMm[i]);
  result.share_with_failures = wilson_interval(result.patients_with_failures,
                                               static_cast<std::int64_t>(result.patients.size()));
  result.rate = mean_over_cases(rates, counting.seed);
  result.capture_mm = mean_over_cases(ranges_mm, counting.seed);
  result.intervals = intervals_of(all, counting);
  pool_intervals(own, counting, result);
  return result;
}

}  // namespace af::evaluation
