// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/success_rate.h"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <cstddef>

#include "base/error.h"

namespace af::evaluation {

ProportionInterval wilson_interval(std::int64_t successes, std::int64_t trials, double confidence) {
  check(successes >= 0 && successes <= trials, "successes are from 0 to trials");
  check(confidence > 0.0 && confidence < 1.0, "a confidence lies between 0 and 1");
  if (trials == 0) return {};
  const double z = boost::math::quantile(boost::math::normal(), 0.5 + confidence / 2.0);
  const auto n = static_cast<double>(trials);
  const double p = static_cast<double>(successes) / n;
  const double denominator = 1.0 + z * z / n;
  const double center = (p + z * z / (2.0 * n)) / denominator;
  const double half = z * std::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n)) / denominator;
  // The ends are set to exactly 0 and 1, where rounding would leave 1e-17.
  return {successes == 0 ? 0.0 : center - half, successes == trials ? 1.0 : center + half};
}

std::int64_t count_successes(std::span<const TreOutcome> outcomes, double threshold_mm) {
  return std::count_if(outcomes.begin(), outcomes.end(), [&](const TreOutcome& outcome) {
    return outcome.error_mm < threshold_mm;
  });
}

std::optional<CumulativeCaptureRange> cumulative_capture_range(std::span<const TreOutcome> outcomes,
                                                               double share,
                                                               double threshold_mm) {
  check(share > 0.0 && share <= 1.0, "a share lies between 0 and 1");
  std::vector<TreOutcome> sorted;
  for (const TreOutcome& outcome : outcomes)
    if (std::isfinite(outcome.initial_tre_mm)) sorted.push_back(outcome);
  std::sort(sorted.begin(), sorted.end(), [](const TreOutcome& a, const TreOutcome& b) {
    return a.initial_tre_mm < b.initial_tre_mm;
  });
  std::optional<CumulativeCaptureRange> range;
  std::int64_t successes = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    successes += sorted[i].error_mm < threshold_mm ? 1 : 0;
    // Starts with the same initial TRE are taken together.
    if (i + 1 < sorted.size() && sorted[i + 1].initial_tre_mm == sorted[i].initial_tre_mm) continue;
    const auto starts = static_cast<std::int64_t>(i + 1);
    if (static_cast<double>(successes) >= share * static_cast<double>(starts))
      range = {sorted[i].initial_tre_mm, starts, successes, i + 1 == sorted.size()};
  }
  return range;
}

std::vector<IntervalSuccess> success_per_interval(std::span<const TreOutcome> outcomes,
                                                  int intervals,
                                                  double width_mm,
                                                  double threshold_mm) {
  check(intervals > 0 && width_mm > 0.0, "intervals have a count and a width");
  std::vector<IntervalSuccess> result(static_cast<std::size_t>(intervals));
  for (std::size_t k = 0; k < result.size(); ++k) {
    result[k].low_mm = static_cast<double>(k) * width_mm;
    result[k].high_mm = static_cast<double>(k + 1) * width_mm;
  }
  for (const TreOutcome& outcome : outcomes) {
    const double position = outcome.initial_tre_mm / width_mm;
    if (!(position >= 0.0 && position < intervals)) continue;
    IntervalSuccess& interval = result[static_cast<std::size_t>(position)];
    ++interval.trials;
    if (outcome.error_mm < threshold_mm) ++interval.successes;
  }
  for (IntervalSuccess& interval : result)
    interval.wilson = wilson_interval(interval.successes, interval.trials);
  return result;
}

std::vector<IntervalSuccess> pooled_intervals(std::span<const std::vector<IntervalSuccess>> cases,
                                              std::span<const std::size_t> drawn) {
  std::vector<IntervalSuccess> sums = cases[drawn.front()];
  for (const std::size_t index : drawn.subspan(1))
    for (std::size_t k = 0; k < sums.size(); ++k) {
      sums[k].trials += cases[index][k].trials;
      sums[k].successes += cases[index][k].successes;
    }
  return sums;
}

const char* to_string(CaptureEnd end) {
  switch (end) {
    case CaptureEnd::Failures:
      return "failures";
    case CaptureEnd::NoStarts:
      return "no starts";
    case CaptureEnd::LastInterval:
      return "last interval";
  }
  return "";
}

CaptureRange capture_range(std::span<const IntervalSuccess> intervals, double share) {
  check(share > 0.0 && share <= 1.0, "a share lies between 0 and 1");
  CaptureRange range;
  range.end = CaptureEnd::LastInterval;
  for (const IntervalSuccess& interval : intervals) {
    if (interval.trials == 0) {
      range.end = CaptureEnd::NoStarts;
      break;
    }
    if (static_cast<double>(interval.successes) < share * static_cast<double>(interval.trials)) {
      range.end = CaptureEnd::Failures;
      break;
    }
    range.initial_tre_mm = interval.high_mm;
    range.starts += interval.trials;
    range.successes += interval.successes;
    ++range.end_interval;
  }
  return range;
}

}  // namespace af::evaluation
