// SPDX-License-Identifier: Apache-2.0
// How many registrations succeeded, and from how far: what summary.json says of it.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "evaluate/registration/registration_rows.h"
#include "evaluate/registration/registration_statistics.h"

namespace af::evaluation {

/// Of some rows: counts and rate; per interval of initial TRE (`intervals`); below each threshold
/// of a ladder, by TRE (`thresholds`) and by mRPD (`mrpd_thresholds`); gross failures; the capture
/// range of van de Kraats, by TRE and by mRPD, and the cumulative one. docs/errors.md defines each.
nlohmann::json success_statistics(const RowPointers& rows, const StatisticsOptions& options);

/// Adds to `over_cases`: `capture_range_mm`, the mean, smallest and largest of the cases' own
/// capture ranges, how many are lower bounds, and intervals over cases; `pooled_capture_range_mm`,
/// the bootstrap interval over cases of the range of all starts together.
void add_capture_over_cases(const std::map<std::string, RowPointers>& by_case,
                            const StatisticsOptions& options,
                            nlohmann::json& over_cases);

}  // namespace af::evaluation
