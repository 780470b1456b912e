// SPDX-License-Identifier: Apache-2.0
#include "evaluate/population/population_statistics.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <span>
#include <utility>

#include "base/hash_random.h"
#include "base/sample_summary.h"
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

/// Rates that an interval may truly have had. Looked up, because many intervals have the same few
/// starts.
class PlausibleRates {
 public:
  /// `share` in [0, 1) says which of them.
  double at(const IntervalSuccess& interval, double share) {
    std::vector<double>& rates = rates_[{interval.successes, interval.trials}];
    if (rates.empty())
      for (int i = 0; i < kRates; ++i)
        rates.push_back(plausible_rate(interval.successes, interval.trials, (i + 0.5) / kRates));
    return rates[static_cast<std::size_t>(share * kRates)];
  }

 private:
  static constexpr int kRates = 256;
  std::map<std::pair<std::int64_t, std::int64_t>, std::vector<double>> rates_;
};

/// Interval of plausible capture ranges of the patient: each interval keeps its number of starts,
/// gets a true rate that is plausible given its successes, and successes are drawn with that rate.
/// Two successes of two starts say little about an interval.
MeanInterval capture_interval(const std::vector<IntervalSuccess>& intervals,
                              std::uint64_t seed,
                              PlausibleRates& rates) {
  constexpr int kReplicates = 1000;
  std::vector<double> ranges_mm;
  for (int replicate = 0; replicate < kReplicates; ++replicate) {
    HashRandom random(seed, static_cast<std::uint64_t>(replicate));
    std::vector<IntervalSuccess> drawn = intervals;
    for (IntervalSuccess& interval : drawn) {
      if (interval.trials == 0) continue;
      const double rate = rates.at(interval, random.uniform());
      interval.successes = 0;
      for (std::int64_t i = 0; i < interval.trials; ++i)
        interval.successes += random.uniform() < rate ? 1 : 0;
    }
    ranges_mm.push_back(capture_range(drawn).initial_tre_mm);
  }
  std::sort(ranges_mm.begin(), ranges_mm.end());
  return {quantile(ranges_mm, 0.025), quantile(ranges_mm, 0.975)};
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
  PlausibleRates rates;
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
    success.capture_interval_mm =
        capture_interval(own.back(), hash64(counting.seed, hash_name(patient->patient)), rates);
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
