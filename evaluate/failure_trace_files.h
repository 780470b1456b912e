// SPDX-License-Identifier: Apache-2.0
// How registrations that failed searched: kept within stated bounds.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "evaluate/registration_rows_files.h"
#include "evaluate/yardstick_files.h"
#include "io/csv_table.h"
#include "register/registration.h"

namespace af::evaluation {

/// So many failures of each case and method keep their traces: those of the lowest start indices.
inline constexpr std::size_t kMostTraces = 60;
/// So many steps of a trace are kept: of longer ones the first, the last and evenly spread others.
inline constexpr std::size_t kMostTracePoints = 200;

/// A search as seen from the gold pose. `frame` is what the trace's parameters are relative to.
std::vector<TracePoint> trace_points(const std::vector<registration::TraceRow>& trace,
                                     const PoseFrame& frame,
                                     const Yardstick& yardstick);

/// Drops all but the first `kMostTraces` traces of a renderer's rows, which are those of one case.
/// \test FailureTraces.AreKeptOfTheFirstFailuresOfAMethodOnly
void keep_first_traces(std::vector<RegistrationRow>& rows, const std::string& renderer);

/// stage, step_mm, poses_tried, similarity, rx_deg ... tz_mm (relative to gold), tre_mm.
CsvTable trace_table(const std::vector<TracePoint>& trace);

}  // namespace af::evaluation
