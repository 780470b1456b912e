// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration_rows_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "evaluate/statistics.h"
#include "evaluate/summary_files.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr std::array<const char*, 6> kParameterNames = {
    "rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm"};
constexpr std::array<double, 5> kThresholdsMm = {1.0, 2.0, 2.5, 5.0, 10.0};

void append_numbers(std::vector<std::string>& fields, const std::array<double, 6>& values) {
  for (const double value : values) fields.push_back(number_text(value));
}

json interval_json(const IntervalSuccess& interval) {
  return {{"low_mm", interval.low_mm},
          {"high_mm", interval.high_mm},
          {"starts", interval.trials},
          {"successes", interval.successes},
          {"rate", number_json(interval.rate())},
          {"wilson_low", interval.wilson.low},
          {"wilson_high", interval.wilson.high}};
}

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

/// Success, TRE and times of some rows.
json statistics_of(const std::vector<const RegistrationRow*>& rows) {
  std::vector<TreOutcome> outcomes;
  std::vector<double> tre_mm;
  std::vector<double> successful_tre_mm;
  std::vector<double> seconds;
  std::vector<double> evaluations;
  std::map<std::string, int> stop_reasons;
  for (const RegistrationRow* row : rows) {
    outcomes.push_back({row->initial_tre_mm, row->tre_mm});
    if (std::isfinite(row->tre_mm)) tre_mm.push_back(row->tre_mm);
    if (row->tre_mm < kSuccessTreMm) successful_tre_mm.push_back(row->tre_mm);
    seconds.push_back(row->seconds);
    evaluations.push_back(static_cast<double>(row->evaluations));
    ++stop_reasons[row->stop_reason];
  }
  const auto trials = static_cast<std::int64_t>(outcomes.size());
  json result = proportion_json(count_successes(outcomes, kSuccessTreMm), trials);
  result["without_pose"] = outcomes.size() - tre_mm.size();
  result["tre_mm"] = to_json(summarize(tre_mm));
  result["tre_of_successes_mm"] = to_json(summarize(successful_tre_mm));
  result["thresholds"] = json::array();
  for (const double threshold : kThresholdsMm) {
    json entry = proportion_json(count_successes(outcomes, threshold), trials);
    entry["threshold_mm"] = threshold;
    result["thresholds"].push_back(entry);
  }
  result["stop_reasons"] = stop_reasons;
  result["seconds"] = to_json(summarize(seconds));
  result["evaluations"] = to_json(summarize(evaluations));
  return result;
}

}  // namespace

json packed_row(std::int64_t order, const RegistrationRow& row) {
  return {order,
          row.case_name,
          row.renderer,
          row.start_index,
          row.draw_index,
          row.interval,
          row.start_deg_mm,
          row.final_deg_mm,
          {row.initial_tre_mm, row.tre_mm, row.stated_pose_tre_mm, row.similarity, row.seconds},
          {row.evaluations, row.inadmissible, row.drr_count},
          row.stop_reason,
          row.error};
}

RegistrationRow row_of(const json& packed) {
  RegistrationRow row;
  row.case_name = packed[1].get<std::string>();
  row.renderer = packed[2].get<std::string>();
  row.start_index = packed[3].get<std::int64_t>();
  row.draw_index = packed[4].get<std::uint64_t>();
  row.interval = packed[5].get<int>();
  row.start_deg_mm = packed[6].get<std::array<double, 6>>();
  row.final_deg_mm = packed[7].get<std::array<double, 6>>();
  const auto values = packed[8].get<std::array<double, 5>>();
  row.initial_tre_mm = values[0];
  row.tre_mm = values[1];
  row.stated_pose_tre_mm = values[2];
  row.similarity = values[3];
  row.seconds = values[4];
  const auto counts = packed[9].get<std::array<std::int64_t, 3>>();
  row.evaluations = counts[0];
  row.inadmissible = counts[1];
  row.drr_count = counts[2];
  row.stop_reason = packed[10].get<std::string>();
  row.error = packed[11].get<std::string>();
  return row;
}

CsvTable registrations_table(const std::vector<RegistrationRow>& rows) {
  std::vector<std::string> columns = {"case", "start_index", "renderer"};
  for (const char* when : {"start_", "final_"})
    for (const char* name : kParameterNames) columns.push_back(std::string(when) + name);
  for (const char* name : {"initial_tre_mm",
                           "tre_mm",
                           "similarity",
                           "evaluations",
                           "stop_reason",
                           "success",
                           "interval",
                           "draw_index",
                           "stated_pose_tre_mm",
                           "inadmissible",
                           "drr_count",
                           "error",
                           "seconds"})
    columns.emplace_back(name);
  CsvTable table(columns);
  for (const RegistrationRow& row : rows) {
    std::vector<std::string> fields = {
        row.case_name, std::to_string(row.start_index), row.renderer};
    append_numbers(fields, row.start_deg_mm);
    append_numbers(fields, row.final_deg_mm);
    fields.push_back(number_text(row.initial_tre_mm));
    fields.push_back(number_text(row.tre_mm));
    fields.push_back(number_text(row.similarity));
    fields.push_back(std::to_string(row.evaluations));
    fields.push_back(row.stop_reason);
    fields.emplace_back(row.tre_mm < kSuccessTreMm ? "1" : "0");
    fields.push_back(std::to_string(row.interval));
    fields.push_back(std::to_string(row.draw_index));
    fields.push_back(number_text(row.stated_pose_tre_mm));
    fields.push_back(std::to_string(row.inadmissible));
    fields.push_back(std::to_string(row.drr_count));
    fields.push_back(row.error);
    fields.push_back(number_text(row.seconds));
    table.add_row(std::move(fields));
  }
  return table;
}

CsvTable starts_table(const std::vector<std::string>& case_names,
                      const std::vector<StratifiedStarts>& starts) {
  std::vector<std::string> columns = {"case", "start_index", "interval", "draw_index"};
  for (const char* name : kParameterNames) columns.push_back(std::string("start_") + name);
  columns.emplace_back("initial_tre_mm");
  for (const char row : {'0', '1', '2'})
    for (const char column : {'0', '1', '2', '3'})
      columns.push_back(std::string("m") + row + column);
  CsvTable table(columns);
  for (std::size_t c = 0; c < starts.size(); ++c) {
    for (std::size_t i = 0; i < starts[c].starts.size(); ++i) {
      const PerturbedStart& start = starts[c].starts[i];
      std::vector<std::string> fields = {case_names[c],
                                         std::to_string(i),
                                         std::to_string(start.interval),
                                         std::to_string(start.draw_index)};
      append_numbers(fields, start.parameters.deg_and_mm());
      fields.push_back(number_text(start.initial_tre_mm));
      for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column)
          fields.push_back(number_text(start.room_from_ct.matrix()(row, column)));
      table.add_row(std::move(fields));
    }
  }
  return table;
}

std::vector<TreOutcome> outcomes_of(const std::vector<RegistrationRow>& rows,
                                    const std::string& renderer) {
  std::vector<TreOutcome> outcomes;
  for (const RegistrationRow& row : rows)
    if (row.renderer == renderer) outcomes.push_back({row.initial_tre_mm, row.tre_mm});
  return outcomes;
}

json renderer_statistics(const std::vector<RegistrationRow>& rows,
                         const std::string& renderer,
                         const TreIntervals& intervals) {
  std::vector<const RegistrationRow*> mine;
  std::map<std::string, std::vector<const RegistrationRow*>> by_case;
  std::vector<double> stated_pose_tre_mm;
  for (const RegistrationRow& row : rows) {
    if (row.renderer != renderer) continue;
    mine.push_back(&row);
    by_case[row.case_name].push_back(&row);
    if (row.tre_mm < kSuccessTreMm && std::isfinite(row.stated_pose_tre_mm))
      stated_pose_tre_mm.push_back(row.stated_pose_tre_mm);
  }
  json result = statistics_of(mine);
  result["renderer"] = renderer;
  result["stated_pose_tre_of_successes_mm"] = to_json(summarize(stated_pose_tre_mm));
  result["intervals"] = json::array();
  for (const IntervalSuccess& interval :
       success_per_interval(outcomes_of(rows, renderer), intervals.count, intervals.width_mm))
    result["intervals"].push_back(interval_json(interval));
  result["cases"] = json::array();
  for (const auto& [name, case_rows] : by_case) {
    json entry = statistics_of(case_rows);
    entry["case"] = name;
    result["cases"].push_back(entry);
  }
  return result;
}

json paired_statistics(const std::vector<RegistrationRow>& rows, double margin_mm) {
  // Field first, ray casting second.
  std::map<std::pair<std::string, std::int64_t>, std::array<const RegistrationRow*, 2>> by_start;
  for (const RegistrationRow& row : rows)
    by_start[{row.case_name, row.start_index}][row.renderer == "field" ? 0 : 1] = &row;
  std::array<std::vector<double>, 2> seconds;
  std::array<std::vector<double>, 2> tre_mm;
  std::array<std::int64_t, 2> successes{};
  for (const auto& [start, pair] : by_start) {
    if (pair[0] == nullptr || pair[1] == nullptr) continue;
    const std::array<bool, 2> succeeded = {pair[0]->tre_mm < kSuccessTreMm,
                                           pair[1]->tre_mm < kSuccessTreMm};
    for (std::size_t side = 0; side < 2; ++side) {
      seconds[side].push_back(pair[side]->seconds);
      successes[side] += succeeded[side] ? 1 : 0;
      if (succeeded[0] && succeeded[1]) tre_mm[side].push_back(pair[side]->tre_mm);
    }
  }
  if (seconds[0].empty()) return nullptr;
  json result = {{"common_starts", seconds[0].size()},
                 {"successes", successes},
                 {"median_seconds", {summarize(seconds[0]).median, summarize(seconds[1]).median}},
                 {"pairs", tre_mm[0].size()}};
  if (tre_mm[0].size() < 2) return result;
  const PairedComparison comparison = compare_paired(tre_mm[0], tre_mm[1], margin_mm);
  result["test"] = {{"mean_difference_mm", comparison.mean_difference},
                    {"low_90_mm", comparison.low_90},
                    {"high_90_mm", comparison.high_90},
                    {"t_test_p", comparison.t_test_p},
                    {"margin_mm", comparison.margin},
                    {"equivalence_p", comparison.equivalence_p}};
  return result;
}

}  // namespace af::evaluation
