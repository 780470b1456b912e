// SPDX-License-Identifier: Apache-2.0
#include "evaluate/summary_files.h"

#include <cmath>
#include <limits>

namespace af::evaluation {

using nlohmann::json;

json number_json(double value) {
  if (std::isnan(value)) return nullptr;
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  return value;
}

double number_of(const json& value) {
  if (value.is_number()) return value.get<double>();
  if (value == "inf") return std::numeric_limits<double>::infinity();
  if (value == "-inf") return -std::numeric_limits<double>::infinity();
  return std::numeric_limits<double>::quiet_NaN();
}

json to_json(const SampleSummary& summary) {
  return {{"count", summary.count},
          {"mean", number_json(summary.mean)},
          {"sd", number_json(summary.standard_deviation)},
          {"min", number_json(summary.minimum)},
          {"p5", number_json(summary.percentile_5)},
          {"q1", number_json(summary.lower_quartile)},
          {"median", number_json(summary.median)},
          {"q3", number_json(summary.upper_quartile)},
          {"p95", number_json(summary.percentile_95)},
          {"max", number_json(summary.maximum)}};
}

}  // namespace af::evaluation
