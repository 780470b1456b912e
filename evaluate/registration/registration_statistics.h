// SPDX-License-Identifier: Apache-2.0
// What summary.json says about the registrations of a run.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "evaluate/registration/registration_rows.h"

namespace af::evaluation {

/// An error (RegistrationRow::decisive_mm()) of this or more, or no pose at all, is a gross
/// failure.
inline constexpr double kGrossFailureMm = 10.0;

/// How initial TRE is divided, the seed of the bootstrap, and what a success is.
struct StatisticsOptions {
  int intervals = 8;
  double interval_width_mm = 2.0;
  std::uint64_t seed = 1;
  double success_tre_mm = kSuccessTreMm;
};

/// Statistics of one renderer, which docs/errors.md defines:
/// - which error counts ends (`error`), counts, success (overall, per interval, per threshold),
/// gross
///   failures, failures by reason, capture ranges;
/// - that error, TRE and one view's depth over all runs (no pose counts as infinitely far) and over
///   successes; bias, the other errors, stop reasons and times;
/// - the same per case, and intervals over patients (`over_cases`, whose cases are those of
///   patient_of_case()).
/// \test RegistrationStatistics.CasesOfOnePatientAreOnePatient
nlohmann::json renderer_statistics(std::span<const RegistrationRow> rows,
                                   const std::string& renderer,
                                   const StatisticsOptions& options);

/// Says in words what is wrong with a set of rows: registrations that occur twice, NaN beside a
/// pose, initial TREs that are not finite. Empty when nothing is.
std::vector<std::string> row_problems(std::span<const RegistrationRow> rows);

/// How many patients the cases belong to (patient_of_case()).
std::size_t patient_count(std::span<const std::string> case_names);

/// Says in words which conclusions so few patients do not allow. Empty when there are enough.
std::vector<std::string> warnings_about_patients(std::size_t patients);

}  // namespace af::evaluation
