// SPDX-License-Identifier: Apache-2.0
// How failed registrations searched, kept to a limited size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "evaluate/registration/registration_rows.h"
#include "evaluate/registration/yardstick.h"
#include "files/csv_table.h"
#include "register/method/registration_result.h"

namespace af::evaluation {

/// How many failures of each case and method keep their traces: those of the lowest start indices.
inline constexpr std::size_t kMostTraces = 60;
/// How many steps of a trace are kept: the first, the last, and others evenly spread.
inline constexpr std::size_t kMostTracePoints = 200;

/// A search as seen from the gold pose. The trace's parameters are relative to `frame`.
std::vector<TracePoint> trace_points(const std::vector<registration::TraceRow>& trace,
                                     const PoseFrame& frame,
                                     const Yardstick& yardstick);

/// The failures of one case and method that keep their traces, by start index.
using FirstTraces = std::map<std::int64_t, std::vector<TracePoint>>;

/// Adds the trace of a start, unless it is empty or there are `kMostTraces` with lower indices.
/// Starts come in any order. \test FailureTraces.AreKeptOfTheFirstFailuresOfAMethodOnly
void keep_if_first(std::int64_t start_index, std::vector<TracePoint> trace, FirstTraces& kept);

/// Where a failure's trace lies in the run's folder: "traces/CASE-RENDERER-START.csv".
std::string trace_file(const std::string& case_name,
                       const std::string& renderer,
                       std::int64_t start_index);

/// Columns stage, step_mm, poses_tried, similarity, rx_deg ... tz_mm (relative to gold), tre_mm.
CsvTable trace_table(const std::vector<TracePoint>& trace);

}  // namespace af::evaluation
