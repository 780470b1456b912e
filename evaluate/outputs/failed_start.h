// SPDX-License-Identifier: Apache-2.0
// What a run keeps so that a failed start can be looked into.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace af::evaluation {

/// Where a failure's trace is below the run's folder: "traces/CASE-RENDERER-START.csv".
std::string trace_file(const std::string& case_name,
                       const std::string& renderer,
                       std::int64_t start_index);

/// One line for a shell that repeats one start of a run alone and gives the same row. Empty when
/// the run's summary.json (key `repeat`) has nothing to repeat: the poses come from another
/// program.
/// \test EvaluateProgram.RepeatsAFailedStartByTheCommandInTheReport
std::string repeat_command(const nlohmann::json& summary,
                           const std::string& case_name,
                           const std::string& renderer,
                           std::int64_t start_index);

}  // namespace af::evaluation
