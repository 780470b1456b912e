// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/success_statistics.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/sample_summary.h"
#include "evaluate/registration/case_intervals.h"
#include "evaluate/statistics/bootstrap.h"
#include "evaluate/statistics/success_rate.h"
#include "files/number_json.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

std::vector<TreOutcome> outcomes_of(const RowPointers& rows) {
  std::vector<TreOutcome> outcomes;
  outcomes.reserve(rows.size());
  for (const RegistrationRow* row : rows)
    outcomes.push_back({row->initial_tre_mm, row->decisive_mm()});
  return outcomes;
}

json ladder_json(const std::vector<TreOutcome>& outcomes) {
  json ladder = json::array();
  for (const double threshold_mm : kLadderMm) {
    ladder.push_back(proportion_json(count_successes(outcomes, threshold_mm),
                                     static_cast<std::int64_t>(outcomes.size())));
    ladder.back()["threshold_mm"] = threshold_mm;
  }
  return ladder;
}

std::vector<IntervalSuccess> intervals_of(const std::vector<TreOutcome>& outcomes,
                                          const StatisticsOptions& options) {
  return success_per_interval(
      outcomes, options.intervals, options.interval_width_mm, options.success_tre_mm);
}

/// null without starts.
json capture_json(const std::vector<IntervalSuccess>& intervals) {
  const bool is_empty =
      std::all_of(intervals.begin(), intervals.end(), [](const IntervalSuccess& interval) {
        return interval.trials == 0;
      });
  if (is_empty) return nullptr;
  const CaptureRange range = capture_range(intervals);
  json result = {{"initial_tre_mm", range.initial_tre_mm},
                 {"starts", range.starts},
                 {"successes", range.successes},
                 {"is_whole_study", range.is_whole_study()},
                 {"ended_by", to_string(range.end)}};
  if (range.end_interval < intervals.size())
    result["end_interval"] = interval_json(intervals[range.end_interval]);
  return result;
}

json cumulative_capture_json(const std::vector<TreOutcome>& outcomes, double success_tre_mm) {
  const std::optional<CumulativeCaptureRange> range =
      cumulative_capture_range(outcomes, kCaptureShare, success_tre_mm);
  if (!range.has_value()) return nullptr;
  return {{"initial_tre_mm", range->initial_tre_mm},
          {"starts", range->starts},
          {"successes", range->successes},
          {"is_whole_study", range->is_whole_study}};
}

}  // namespace

json success_statistics(const RowPointers& rows, const StatisticsOptions& options) {
  const std::vector<TreOutcome> outcomes = outcomes_of(rows);
  const std::vector<IntervalSuccess> intervals = intervals_of(outcomes, options);
  const auto trials = static_cast<std::int64_t>(rows.size());
  json result = proportion_json(count_successes(outcomes, options.success_tre_mm), trials);
  result["intervals"] = json::array();
  for (const IntervalSuccess& interval : intervals)
    result["intervals"].push_back(interval_json(interval));
  result["thresholds"] = ladder_json(outcomes);
  result["gross_failures"] =
      proportion_json(trials - count_successes(outcomes, kGrossFailureMm), trials);
  result["capture_range"] = capture_json(intervals);
  result["cumulative_capture_range"] = cumulative_capture_json(outcomes, options.success_tre_mm);
  return result;
}

void add_capture_over_patients(const std::map<std::string, RowPointers>& by_patient,
                               const StatisticsOptions& options,
                               json& over_patients) {
  std::vector<std::vector<IntervalSuccess>> patients;
  std::vector<CaseMean> own_ranges;
  std::vector<double> ranges_mm;
  std::int64_t at_least = 0;
  for (const auto& [name, rows] : by_patient) {
    patients.push_back(intervals_of(outcomes_of(rows), options));
    const CaptureRange range = capture_range(patients.back());
    own_ranges.push_back({range.initial_tre_mm, 1.0});
    ranges_mm.push_back(range.initial_tre_mm);
    at_least += range.is_whole_study() ? 1 : 0;
  }
  const SampleSummary summary = summarize(ranges_mm);
  json own = interval_over_cases(own_ranges, options.seed);
  own["mean_mm"] = number_json(summary.mean);
  own["min_mm"] = number_json(summary.minimum);
  own["max_mm"] = number_json(summary.maximum);
  own["at_least"] = at_least;
  over_patients["capture_range_mm"] = own;
  over_patients["pooled_capture_range_mm"] = bootstrap_json(bootstrap_over_cases(
      patients.size(),
      [&](std::span<const std::size_t> drawn) {
        return capture_range(pooled_intervals(patients, drawn)).initial_tre_mm;
      },
      options.seed));
}

}  // namespace af::evaluation
