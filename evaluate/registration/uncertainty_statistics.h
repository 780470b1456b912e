// SPDX-License-Identifier: Apache-2.0
// Whether registrations know their own errors: what summary.json says of it.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "evaluate/registration/registration_rows.h"
#include "evaluate/registration/registration_statistics.h"

namespace af::evaluation {

/// Of some rows, by case: how many successes lie inside their 95 % regions, by pose (Mahalanobis)
/// and by TRE (`predicted_tre_95_mm`), with intervals over cases; the area under the ROC curve of
/// confidence, successes against failures; and for some confidences the shares of successes and of
/// failures that have at least so much. null when no row has a confidence. docs/uncertainty.md
/// defines each.
nlohmann::json uncertainty_statistics(const std::map<std::string, RowPointers>& by_case,
                                      const StatisticsOptions& options);

}  // namespace af::evaluation
