// SPDX-License-Identifier: Apache-2.0
#include "evaluate/population/population_statistics.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <span>
#include <utility>

#include "base/hash_random.h"
#include "base/sample_summary.h"

namespace af::evaluation {

namespace {

std::size_t digits_at_end(const std::string& text) {
  std::size_t count = 0;
  while (count < text.size() &&
         std::isdigit(static_cast<unsigned char>(text[text.size() - 1 - count])) != 0)
    ++count;
  return count;
}

const std::vector<TreOutcome>& ends_of(const PatientOutcomes& patient, CountedEnd end) {
  return end == CountedEnd::Tre ? patient.by_tre : patient.by_mrpd;
}

std::vector<IntervalSuccess> intervals_of(const std::vector<TreOutcome>& outcomes,
                                          const PopulationCounting& counting) {
  return success_per_interval(
      outcomes, counting.intervals, counting.interval_width_mm, counting.success_mm);
}

/// The numbers of starts of one interval stay; which of them succeed is drawn with replacement,
/// that is binomial.
MeanInterval capture_interval(const std::vector<IntervalSuccess>& intervals, std::uint64_t seed) {
  constexpr int kReplicates = 1000;
  std::vector<double> ranges_mm;
  for (int replicate = 0; replicate < kReplicates; ++replicate) {
    HashRandom random(seed, static_cast<std::uint64_t>(replicate));
    std::vector<IntervalSuccess> drawn = intervals;
    for (IntervalSuccess& interval : drawn) {
      if (interval.trials == 0) continue;
      const double rate = interval.rate();
      interval.successes = 0;
      for (std::int64_t i = 0; i < interval.trials; ++i)
        interval.successes += random.uniform() < rate ? 1 : 0;
    }
    ranges_mm.push_back(capture_range(drawn).initial_tre_mm);
  }
  std::sort(ranges_mm.begin(), ranges_mm.end());
  return {quantile(ranges_mm, 0.025), quantile(ranges_mm, 0.975)};
}

/// Interval k, or all together, of some patients.
struct Counts {
  std::int64_t trials = 0;
  std::int64_t successes = 0;
  [[nodiscard]] double rate() const {
    return trials > 0 ? static_cast<double>(successes) / static_cast<double>(trials) : kNan;
  }
};

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

std::string patient_of_case(const std::string& case_name) {
  const std::size_t digits = digits_at_end(case_name);
  if (digits == 0 || case_name.size() < digits + 3) return case_name;
  const std::size_t mark = case_name.size() - digits - 2;
  return case_name.compare(mark, 2, "-p") == 0 ? case_name.substr(0, mark) : case_name;
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
  std::vector<double> rates;
  std::vector<double> ranges_mm;
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
    success.capture_interval_mm =
        capture_interval(own.back(), hash64(counting.seed, hash_name(patient->patient)));
    result.starts += success.starts;
    result.successes += success.successes;
    rates.push_back(Counts{success.starts, success.successes}.rate());
    ranges_mm.push_back(success.capture.initial_tre_mm);
    result.patients.push_back(std::move(success));
  }
  const auto resampled = [&](const auto& statistic) {
    return bootstrap_over_cases(patients.size(), statistic, counting.seed);
  };
  result.rate.value = Counts{result.starts, result.successes}.rate();
  result.rate.student = student_interval(rates);
  result.rate.bootstrap = resampled([&](std::span<const std::size_t> drawn) {
    Counts sum;
    for (const std::size_t i : drawn) {
      sum.trials += result.patients[i].starts;
      sum.successes += result.patients[i].successes;
    }
    return sum.rate();
  });
  const auto mean_range = [&](std::span<const std::size_t> drawn) {
    double sum_mm = 0.0;
    for (const std::size_t i : drawn) sum_mm += ranges_mm[i];
    return sum_mm / static_cast<double>(drawn.size());
  };
  double sum_mm = 0.0;
  for (const double range_mm : ranges_mm) sum_mm += range_mm;
  result.capture_mm.value = sum_mm / static_cast<double>(ranges_mm.size());
  result.capture_mm.student = student_interval(ranges_mm);
  result.capture_mm.bootstrap = resampled(mean_range);
  result.intervals = intervals_of(all, counting);
  result.pooled = capture_range(result.intervals);
  result.pooled_interval_mm = resampled([&](std::span<const std::size_t> drawn) {
    std::vector<IntervalSuccess> sums = own[drawn.front()];
    for (const std::size_t i : drawn.subspan(1))
      for (std::size_t k = 0; k < sums.size(); ++k) {
        sums[k].trials += own[i][k].trials;
        sums[k].successes += own[i][k].successes;
      }
    return capture_range(sums).initial_tre_mm;
  });
  for (std::size_t k = 0; k < result.intervals.size(); ++k)
    result.interval_bootstraps.push_back(resampled([&](std::span<const std::size_t> drawn) {
      Counts sum;
      for (const std::size_t i : drawn) {
        sum.trials += own[i][k].trials;
        sum.successes += own[i][k].successes;
      }
      return sum.rate();
    }));
  return result;
}

}  // namespace af::evaluation
