// SPDX-License-Identifier: Apache-2.0
// Whether registrations know their own errors: what summary.json says of it.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "evaluate/registration/registration_rows.h"
#include "evaluate/registration/registration_statistics.h"

namespace af::evaluation {

/// Of some rows, by patient: how many right ends (RegistrationRow::is_success()) lie inside their
/// 95 % regions, by pose (Mahalanobis) and by TRE (`predicted_tre_95_mm`), with intervals over
/// patients; the area under the ROC curve of confidence, right ends against others; and for some
/// confidences the shares of both that have at least so much; how many of both have each verdict.
/// null when no row has a confidence.
/// docs/uncertainty.md defines each.
nlohmann::json uncertainty_statistics(const std::map<std::string, RowPointers>& by_patient,
                                      const StatisticsOptions& options);

}  // namespace af::evaluation
