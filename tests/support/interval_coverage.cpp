// SPDX-License-Identifier: Apache-2.0
#include "support/interval_coverage.h"

#include <cmath>
#include <span>
#include <vector>

#include "base/hash_random.h"
#include "evaluate/statistics/bootstrap.h"
#include "evaluate/statistics/case_equivalence.h"
#include "evaluate/statistics/statistics.h"
#include "evaluate/statistics/success_rate.h"

namespace af::test {
namespace {

constexpr double kMeanTreMm = 0.3;

/// What the cases of one study gave.
struct StudyMeans {
  std::vector<double> rates;
  std::vector<double> tre_mm;
  std::int64_t successes = 0;
};

StudyMeans simulate(const SimulatedStudies& setting, std::uint64_t study) {
  HashRandom random(setting.seed, setting.cases, study);
  const auto starts = static_cast<double>(setting.starts_per_case);
  const double log_sd = 2.0 * setting.half_spread;
  StudyMeans means;
  for (std::size_t i = 0; i < setting.cases; ++i) {
    const double own_rate =
        setting.mean_rate + setting.half_spread * (2.0 * random.uniform() - 1.0);
    const double own_tre_mm =
        kMeanTreMm * std::exp(log_sd * random.normal() - 0.5 * log_sd * log_sd);
    int successes = 0;
    double tre_sum_mm = 0.0;
    for (int start = 0; start < setting.starts_per_case; ++start) {
      successes += random.uniform() < own_rate ? 1 : 0;
      tre_sum_mm += own_tre_mm * random.uniform(0.5, 1.5);
    }
    means.rates.push_back(successes / starts);
    means.tre_mm.push_back(tre_sum_mm / starts);
    means.successes += successes;
  }
  return means;
}

/// Counts of intervals that hold a truth; comparisons with NaN are false.
struct Covered {
  std::uint64_t bootstrap = 0;
  std::uint64_t student = 0;

  void add(const std::vector<double>& values,
           double truth,
           std::uint64_t seed,
           std::size_t replicates) {
    const evaluation::CaseBootstrap resampled = evaluation::bootstrap_over_cases(
        values.size(),
        [&](std::span<const std::size_t> drawn) {
          double sum = 0.0;
          for (const std::size_t index : drawn) sum += values[index];
          return sum / static_cast<double>(drawn.size());
        },
        seed,
        replicates);
    bootstrap += resampled.low <= truth && truth <= resampled.high ? 1 : 0;
    const evaluation::MeanInterval interval = evaluation::student_interval(values);
    student += interval.low <= truth && truth <= interval.high ? 1 : 0;
  }
};

}  // namespace

IntervalCoverage interval_coverage(const SimulatedStudies& setting) {
  std::uint64_t wilson = 0;
  Covered rate;
  Covered tre;
  const std::int64_t trials =
      static_cast<std::int64_t>(setting.cases) * static_cast<std::int64_t>(setting.starts_per_case);
  for (std::uint64_t study = 0; study < setting.studies; ++study) {
    const StudyMeans means = simulate(setting, study);
    const evaluation::ProportionInterval interval =
        evaluation::wilson_interval(means.successes, trials);
    wilson += interval.low <= setting.mean_rate && setting.mean_rate <= interval.high ? 1 : 0;
    rate.add(means.rates, setting.mean_rate, study, setting.replicates);
    tre.add(means.tre_mm, kMeanTreMm, study, setting.replicates);
  }
  const auto share = [&](std::uint64_t count) {
    return static_cast<double>(count) / static_cast<double>(setting.studies);
  };
  return {share(wilson),
          share(rate.bootstrap),
          share(rate.student),
          share(tre.bootstrap),
          share(tre.student)};
}

RareFailureCoverage rare_failure_coverage(const StudiesOfRareFailures& setting) {
  const double true_rate = 1.0 - setting.hard_share * setting.lost_share / setting.poses;
  const double true_failing =
      setting.hard_share * (1.0 - std::pow(1.0 - setting.lost_share, setting.starts_per_pose));
  std::uint64_t wilson = 0;
  Covered rate;
  for (std::uint64_t study = 0; study < setting.studies; ++study) {
    HashRandom random(setting.seed, hash64(setting.cases, 0x72617265), study);  // "rare"
    std::vector<double> rates;
    std::int64_t failing = 0;
    for (std::size_t i = 0; i < setting.cases; ++i) {
      int lost = 0;
      if (random.uniform() < setting.hard_share)
        for (int start = 0; start < setting.starts_per_pose; ++start)
          lost += random.uniform() < setting.lost_share ? 1 : 0;
      rates.push_back(1.0 - static_cast<double>(lost) / (setting.poses * setting.starts_per_pose));
      failing += lost > 0 ? 1 : 0;
    }
    rate.add(rates, true_rate, study, setting.replicates);
    const evaluation::ProportionInterval interval =
        evaluation::wilson_interval(failing, static_cast<std::int64_t>(setting.cases));
    wilson += interval.low <= true_failing && true_failing <= interval.high ? 1 : 0;
  }
  const auto studies = static_cast<double>(setting.studies);
  return {static_cast<double>(rate.bootstrap) / studies,
          static_cast<double>(rate.student) / studies,
          static_cast<double>(wilson) / studies};
}

double wrong_equivalence_claims(const StudiesAtTheMargin& setting) {
  constexpr double kMarginMm = 0.1;
  std::uint64_t claims = 0;
  for (std::uint64_t study = 0; study < setting.studies; ++study) {
    HashRandom random(setting.seed, hash64(setting.cases, 0x6D617267), study);  // "marg"
    std::vector<double> means_mm;
    for (std::size_t i = 0; i < setting.cases; ++i)
      means_mm.push_back(kMarginMm * std::exp(setting.log_sd * random.normal() -
                                              0.5 * setting.log_sd * setting.log_sd));
    const evaluation::CaseEquivalence found =
        evaluation::equivalence_over_cases(means_mm, kMarginMm, study, setting.replicates);
    claims += found.is_shown() ? 1u : 0u;
  }
  return static_cast<double>(claims) / static_cast<double>(setting.studies);
}

}  // namespace af::test
