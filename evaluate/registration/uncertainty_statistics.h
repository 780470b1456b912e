// SPDX-License-Identifier: Apache-2.0
// Whether registrations know their own errors, as summary.json states it.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "evaluate/registration/registration_rows.h"
#include "evaluate/registration/registration_statistics.h"

namespace af::evaluation {

/// Statistics of some rows, by case. In how many cases the right end
/// (RegistrationRow::is_success()) with the median error lies inside its 95 % region, by pose
/// (Mahalanobis) and by TRE (`predicted_tre_95_mm`, and the gold standard's own). Intervals are
/// over patients, because starts of one case share its X-rays and most of their error.
/// Over rows: the area under the ROC curve of confidence, right ends against others; for some
/// confidences, the shares of both with at least that confidence; and how many of both have each
/// verdict. null when no row has a confidence. docs/uncertainty.md defines each. \test
/// RegistrationStatistics.CountCoverageOverCases
nlohmann::json uncertainty_statistics(const std::map<std::string, RowPointers>& by_case,
                                      const StatisticsOptions& options);

}  // namespace af::evaluation
