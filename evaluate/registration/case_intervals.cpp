// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/case_intervals.h"

#include "files/number_json.h"

namespace af::evaluation {

using nlohmann::json;

json proportion_json(std::int64_t successes, std::int64_t trials) {
  const ProportionInterval wilson = wilson_interval(successes, trials);
  return {{"successes", successes},
          {"starts", trials},
          {"rate",
           trials > 0 ? json(static_cast<double>(successes) / static_cast<double>(trials))
                      : json(nullptr)},
          {"wilson_low", wilson.low},
          {"wilson_high", wilson.high}};
}

json interval_json(const IntervalSuccess& interval) {
  json result = proportion_json(interval.successes, interval.trials);
  result["low_mm"] = interval.low_mm;
  result["high_mm"] = interval.high_mm;
  return result;
}

json bootstrap_json(const CaseBootstrap& bootstrap) {
  return {{"cases", bootstrap.cases},
          {"replicates", bootstrap.replicates},
          {"undefined", bootstrap.undefined},
          {"low", number_json(bootstrap.low)},
          {"high", number_json(bootstrap.high)},
          {"is_optimistic", bootstrap.is_optimistic()}};
}

json interval_over_cases(const std::vector<CaseMean>& cases, std::uint64_t seed) {
  const MeanOverCases mean = mean_over_cases(cases, seed);
  json result = bootstrap_json(mean.bootstrap);
  result["student_low"] = number_json(mean.student.low);
  result["student_high"] = number_json(mean.student.high);
  return result;
}

}  // namespace af::evaluation
