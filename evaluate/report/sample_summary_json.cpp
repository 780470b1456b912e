// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/sample_summary_json.h"

namespace af::evaluation {

using nlohmann::json;

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
