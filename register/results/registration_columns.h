// SPDX-License-Identifier: Apache-2.0
// The columns of registrations.csv, which af-register and af-evaluate write.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "register/method/correction.h"
#include "register/uncertainty/uncertainty_report.h"
#include "register/verdict/verdict.h"

namespace af::registration {

/// What every registrations.csv says of a registration. NaN: not known.
struct RegistrationCells {
  std::string case_name;
  std::int64_t start_index = 0;
  std::string renderer;
  std::array<double, 6> start_deg_mm{};
  std::array<double, 6> final_deg_mm{};
  double initial_tre_mm = std::numeric_limits<double>::quiet_NaN();
  double tre_mm = std::numeric_limits<double>::quiet_NaN();
  double similarity = std::numeric_limits<double>::quiet_NaN();
  std::int64_t evaluations = 0;
  std::string stop_reason;
  std::int64_t inadmissible = 0;
  std::int64_t drr_count = 0;
  std::string chain;  ///< of the method, whose end was taken; empty for other programs' poses
  double seconds = 0.0;
};

/// Name of a column, which must last, and the text in it.
using NamedCells = std::vector<std::pair<std::string_view, std::string>>;

/// A row in the order of the columns: the contract's, with a program's own columns after the stop
/// reason and before the time.
NamedCells registration_row(const RegistrationCells& row,
                            const NamedCells& behind_stop_reason,
                            const NamedCells& before_seconds);

/// What a correction adds before the time; empty cells where there was none.
NamedCells correction_cells(const std::optional<CorrectionReport>& correction);

NamedCells judge_cells(const JudgeSummary& judge);

/// Uncertainty: predicted TREs, confidence, inflations, distance of the chains, and the
/// covariance's upper triangle as `cov_rx_rx` (deg^2), `cov_rx_tx` (deg mm) ... `cov_tz_tz` (mm^2).
NamedCells uncertainty_cells(const UncertaintyReport& report, double chain_distance_mm);

void append(const NamedCells& more, NamedCells& cells);

/// The names or the texts alone.
std::vector<std::string> names_of(const NamedCells& cells);
std::vector<std::string> texts_of(NamedCells cells);

}  // namespace af::registration
