// SPDX-License-Identifier: Apache-2.0
// Shares and means with their intervals, as in summary.json.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

#include "evaluate/statistics/bootstrap.h"
#include "evaluate/statistics/success_rate.h"

namespace af::evaluation {

/// {successes, starts, rate (null without starts), wilson_low, wilson_high}.
nlohmann::json proportion_json(std::int64_t successes, std::int64_t trials);

/// The same, with {low_mm, high_mm} of initial TRE.
nlohmann::json interval_json(const IntervalSuccess& interval);

/// {cases, replicates, undefined, low, high, is_optimistic}.
nlohmann::json bootstrap_json(const CaseBootstrap& bootstrap);

/// Intervals by bootstrap over cases, and Student's interval of the cases' own means, in which
/// every case has the same weight: the fields above, and {student_low, student_high}.
nlohmann::json interval_over_cases(const std::vector<CaseMean>& cases, std::uint64_t seed);

}  // namespace af::evaluation
