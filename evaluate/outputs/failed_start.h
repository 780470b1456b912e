// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace af::evaluation {

/// Where a failure's trace is below the run's folder: "traces/CASE-RENDERER-START.csv".
std::string trace_file(const std::string& case_name,
                       const std::string& renderer,
                       std::int64_t start_index);

}  // namespace af::evaluation
