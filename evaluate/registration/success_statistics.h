// SPDX-License-Identifier: Apache-2.0
// How many registrations succeeded, and from how far, as summary.json states it.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "evaluate/registration/registration_rows.h"
#include "evaluate/registration/registration_statistics.h"

namespace af::evaluation {

/// Statistics of some rows by RegistrationRow::decisive_mm(): counts and rate, overall, per
/// interval of initial TRE (`intervals`) and below each threshold of a ladder (`thresholds`); gross
/// failures, the capture range of van de Kraats and the cumulative range. docs/errors.md defines
/// each.
nlohmann::json success_statistics(const RowPointers& rows, const StatisticsOptions& options);

/// Adds two entries to `over_patients`. `capture_range_mm` has the mean, smallest and largest of
/// the patients' own capture ranges, how many are lower bounds, and intervals over patients.
/// `pooled_capture_range_mm` is the bootstrap interval over patients of the range of all starts
/// together.
void add_capture_over_patients(const std::map<std::string, RowPointers>& by_patient,
                               const StatisticsOptions& options,
                               nlohmann::json& over_patients);

}  // namespace af::evaluation
