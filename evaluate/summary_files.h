// SPDX-License-Identifier: Apache-2.0
// What the summaries of all kinds of runs have in common.
#pragma once

#include <nlohmann/json.hpp>

#include "evaluate/statistics.h"

namespace af::evaluation {

/// null for NaN, "inf" for infinity (which JSON lacks).
nlohmann::json number_json(double value);
/// The inverse; NaN for null.
double number_of(const nlohmann::json& value);

/// {count, mean, sd, min, p5, q1, median, q3, p95, max}.
nlohmann::json to_json(const SampleSummary& summary);

}  // namespace af::evaluation
