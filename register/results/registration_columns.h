// SPDX-License-Identifier: Apache-2.0
// The row of a registration in registrations.csv, which af-register and af-evaluate write.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <tuple>

#include "files/csv_cells.h"
#include "register/method/correction.h"
#include "register/verdict/uncertainty_report.h"
#include "register/verdict/verdict.h"

namespace af::registration {

/// What every registrations.csv says about a registration. NaN: unknown.
struct RegistrationRow {
  static constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

  std::string case_name;
  std::string renderer;  ///< "field", "raycast" or the name of another program's poses
  std::int64_t start_index = 0;
  std::array<double, 6> start_deg_mm{};
  std::array<double, 6> final_deg_mm = {kMissing, kMissing, kMissing, kMissing, kMissing, kMissing};
  double initial_tre_mm = kMissing;
  double tre_mm = kMissing;
  double similarity = kMissing;
  std::int64_t evaluations = 0;
  std::string stop_reason;
  std::int64_t inadmissible = 0;
  std::int64_t drr_count = 0;
  std::string chain;  ///< of the method, from which the end comes; empty for other programs' poses
  std::string verdict;  ///< empty where the end was not judged
  JudgeSummary judge = {{kMissing, kMissing}, {kMissing, kMissing}, kMissing, kMissing};
  UncertaintyReport uncertainty;
  double chain_distance_mm = kMissing;
  std::optional<CorrectionReport> correction;  ///< where one was wanted
  double seconds = 0.0;                        ///< wall time

  auto members() {
    return std::tie(case_name,
                    renderer,
                    start_index,
                    start_deg_mm,
                    final_deg_mm,
                    initial_tre_mm,
                    tre_mm,
                    similarity,
                    evaluations,
                    stop_reason,
                    inadmissible,
                    drr_count,
                    chain,
                    verdict,
                    judge,
                    uncertainty,
                    chain_distance_mm,
                    correction,
                    seconds);
  }
};

/// Which parts of the columns a table has.
struct RowParts {
  bool uncertainty = false;
  bool correction = false;
};

/// A program's own columns.
struct OwnCells {
  CsvCells behind_stop_reason = {};
  CsvCells behind_verdict = {};
  CsvCells behind_uncertainty = {};
};

/// A row in the order of the columns: the common ones, with a program's own between them.
CsvCells registration_cells(const RegistrationRow& row, const RowParts& parts, OwnCells own);

/// What a correction adds before the time. Cells are empty where there was none.
CsvCells correction_cells(const std::optional<CorrectionReport>& correction);

CsvCells judge_cells(const JudgeSummary& judge);

/// Uncertainty: predicted TREs, confidence, inflations, distance of the chains, and the
/// covariance's upper triangle as `cov_rx_rx` (deg^2), `cov_rx_tx` (deg mm) ... `cov_tz_tz` (mm^2).
CsvCells uncertainty_cells(const UncertaintyReport& report, double chain_distance_mm);

}  // namespace af::registration
