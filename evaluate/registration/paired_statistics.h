// SPDX-License-Identifier: Apache-2.0
// Field against ray casting from the same starts, as summary.json states it.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "evaluate/registration/registration_rows.h"

namespace af::evaluation {

/// How far the end poses of two rows of one case lie apart, mm: mean over its target points.
using EndDistance = std::function<double(const RegistrationRow& a, const RegistrationRow& b)>;

struct PairedOptions {
  double margin_mm = 0.1;
  std::uint64_t seed = 1;  ///< for the bootstrap
  double success_tre_mm = kSuccessTreMm;
  EndDistance end_distance_mm = {};  ///< empty: `end_distance_mm` is left out
};

/// Field against ray casting on the starts that both were given. States the successes and median
/// seconds of each, McNemar's test of success, and the difference of the patients' success rates
/// with intervals over patients (patient_of_case()).
/// For those from which both succeeded ("pairs"), states the distance of their end poses with
/// intervals and a test of equivalence over patients. Also states the mean difference of
/// RegistrationRow::decisive_mm(), by which success is counted, with tests that take starts for
/// independent. No test is made with fewer than kLeastPairsOfATest starts or pairs. null when no
/// start was given to both.
nlohmann::json paired_statistics(std::span<const RegistrationRow> rows,
                                 const PairedOptions& options);

}  // namespace af::evaluation
