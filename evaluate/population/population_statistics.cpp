// SPDX-License-Identifier: Apache-2.0
#include "evaluate/population/population_statistics.h"

#include <numeric>
#include <span>
#include <utility>

#include "evaluate/statistics/patient_names.h"

namespace af::evaluation {

namespace {

const std::vector<TreOutcome>& ends_of(const PatientOutcomes& patient, CountedEnd end) {
  return end == CountedEnd::Tre ? patient.by_tre : patient.by_mrpd;
}

std::vector<IntervalSuccess> intervals_of(const std::vector<TreOutcome>& outcomes,
                                          const PopulationCounting& counting) {
  return success_per_interval(
      outcomes, counting.intervals, counting.interval_width_mm, counting.success_mm);
}

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// What a statistic of patients becomes when patients are drawn again.
template <typename Statistic>
CaseBootstrap resampled(std::size_t patients,
                        const PopulationCounting& counting,
                        const Statistic& statistic) {
  return bootstrap_over_cases(patients, statistic, counting.seed);
}

/// The starts of some patients together.
IntervalSuccess sum_of(const std::vector<PatientSuccess>& patients,
                       std::span<const std::size_t> drawn) {
  IntervalSuccess sum;
  for (const std::size_t i : drawn) {
    sum.trials += patients[i].starts;
    sum.successes += patients[i].successes;
  }
  return sum;
}

/// Over patients: of all starts; Student's interval is of the mean of the patients' own rates.
OverPatients rate_over(const std::vector<PatientSuccess>& patients,
                       const PopulationCounting& counting) {
  OverPatients rate;
  IntervalSuccess all;
  std::vector<double> rates;
  for (const PatientSuccess& patient : patients) {
    const IntervalSuccess own{0.0, 0.0, patient.starts, patient.successes, {}};
    all.trials += own.trials;
    all.successes += own.successes;
    rates.push_back(own.rate());
  }
  rate.value = all.rate();
  rate.student = student_interval(rates);
  rate.bootstrap = resampled(patients.size(), counting, [&](std::span<const std::size_t> drawn) {
    return sum_of(patients, drawn).rate();
  });
  return rate;
}

/// Mean over patients of their own capture ranges.
OverPatients capture_over(const std::vector<PatientSuccess>& patients,
                          const PopulationCounting& counting) {
  std::vector<double> ranges_mm;
  ranges_mm.reserve(patients.size());
  for (const PatientSuccess& patient : patients)
    ranges_mm.push_back(patient.capture.initial_tre_mm);
  OverPatients capture_mm;
  capture_mm.value = mean_of(ranges_mm);
  capture_mm.student = student_interval(ranges_mm);
  capture_mm.bootstrap =
      resampled(patients.size(), counting, [&](std::span<const std::size_t> drawn) {
        std::vector<double> of_drawn_mm;
        for (const std::size_t i : drawn) of_drawn_mm.push_back(ranges_mm[i]);
        return mean_of(of_drawn_mm);
      });
  return capture_mm;
}

/// All starts together, interval by interval, and what that becomes when patients are drawn again.
void pool_intervals(const std::vector<std::vector<IntervalSuccess>>& own,
                    const PopulationCounting& counting,
                    PopulationSuccess& result) {
  result.pooled = capture_range(result.intervals);
  result.pooled_interval_mm =
      resampled(own.size(), counting, [&](std::span<const std::size_t> drawn) {
        return capture_range(pooled_intervals(own, drawn)).initial_tre_mm;
      });
  for (std::size_t k = 0; k < result.intervals.size(); ++k)
    result.interval_bootstraps.push_back(
        resampled(own.size(), counting, [&](std::span<const std::size_t> drawn) {
          IntervalSuccess sum;
          for (const std::size_t i : drawn) {
            sum.trials += own[i][k].trials;
            sum.successes += own[i][k].successes;
          }
          return sum.rate();
        }));
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
                                     CountedEnd end,
                                     const PopulationCounting& counting) {
  PopulationSuccess result;
  std::vector<std::vector<IntervalSuccess>> own;  // per patient
  std::vector<TreOutcome> all;
  for (const PatientOutcomes* patient : patients) {
    const std::vector<TreOutcome>& outcomes = ends_of(*patient, end);
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
    result.patients.push_back(std::move(success));
  }
  for (std::size_t i = 0; i < kLadderMm.size(); ++i)
    result.below_ladder[i] = count_successes(all, kLadderMm[i]);
  result.share_with_failures = wilson_interval(result.patients_with_failures,
                                               static_cast<std::int64_t>(result.patients.size()));
  result.rate = rate_over(result.patients, counting);
  result.capture_mm = capture_over(result.patients, counting);
  result.intervals = intervals_of(all, counting);
  pool_intervals(own, counting, result);
  return result;
}

}  // namespace af::evaluation
