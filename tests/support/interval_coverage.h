// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace af::test {

/// Simulated studies of patients who differ. A patient's success rate is uniform in mean_rate +-
/// half_spread. A patient's mean TRE is log-normal about 0.3 mm, and its logarithm has a standard
/// deviation of 2 half_spread. Every start is an independent draw, with a TRE uniform in 0.5 to 1.5
/// times the patient's mean.
struct SimulatedStudies {
  std::size_t cases = 4;
  int starts_per_case = 24;
  double mean_rate = 0.8;
  double half_spread = 0.2;  ///< 0: patients do not differ, so all starts are independent
  std::uint64_t studies = 2000;
  std::uint64_t seed = 1;
  std::size_t replicates = 2000;  ///< of the bootstrap
};

/// Shares of the studies whose 95 % intervals hold the truth. An interval that does not exist holds
/// nothing.
struct IntervalCoverage {
  double wilson_rate = 0.0;     ///< of the success rate, taking all starts as independent
  double bootstrap_rate = 0.0;  ///< of the success rate, over cases
  double student_rate = 0.0;
  double bootstrap_tre = 0.0;  ///< of the mean TRE, over cases
  double student_tre = 0.0;
};

IntervalCoverage interval_coverage(const SimulatedStudies& setting);

/// Simulated studies in which nearly all patients succeed from every start. A patient is hard with
/// a probability of `hard_share`. A hard patient loses about `lost_share` of the starts of one
/// pose.
struct StudiesOfRareFailures {
  std::size_t cases = 60;
  int poses = 3;
  int starts_per_pose = 15;
  double hard_share = 0.01;
  double lost_share = 11.0 / 15.0;
  std::uint64_t studies = 2000;
  std::uint64_t seed = 1;
  std::size_t replicates = 2000;  ///< of the bootstrap
};

/// Shares of the studies whose 95 % intervals hold the truth.
struct RareFailureCoverage {
  double bootstrap_rate = 0.0;   ///< of the success rate, over cases
  double student_rate = 0.0;     ///< an interval that does not exist holds nothing
  double wilson_patients = 0.0;  ///< of the share of patients that lose a start
};

RareFailureCoverage rare_failure_coverage(const StudiesOfRareFailures& setting);

/// Simulated studies of the distance between two methods' end poses. The patients' own means are
/// log-normal about the margin itself, so that every claim of equivalence is wrong.
struct StudiesAtTheMargin {
  std::size_t cases = 10;
  double log_sd = 0.4;  ///< standard deviation of the logarithm of a patient's mean
  std::uint64_t studies = 2000;
  std::uint64_t seed = 1;
  std::size_t replicates = 2000;  ///< of the bootstrap
};

/// The share of the studies that claim equivalence.
double wrong_equivalence_claims(const StudiesAtTheMargin& setting);

}  // namespace af::test
