// SPDX-License-Identifier: Apache-2.0
// What the summaries of all kinds of runs have in common.
#pragma once

#include <nlohmann/json.hpp>

#include "base/sample_summary.h"
#include "files/number_json.h"

namespace af::evaluation {

/// {count, mean, sd, min, p5, q1, median, q3, p95, max}.
nlohmann::json to_json(const SampleSummary& summary);

}  // namespace af::evaluation
