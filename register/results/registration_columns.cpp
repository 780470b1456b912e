// SPDX-License-Identifier: Apache-2.0
#include "register/results/registration_columns.h"

#include <utility>

#include "geometry/rigid_transform.h"

namespace af::registration {

CsvCells registration_cells(const RegistrationRow& row, const RowParts& parts, OwnCells own) {
  CsvCells cells = {
      {"case", row.case_name}, {"start_index", row.start_index}, {"renderer", row.renderer}};
  append("start_", kParameterNames, row.start_deg_mm, cells);
  append("final_", kParameterNames, row.final_deg_mm, cells);
  append({{"initial_tre_mm", row.initial_tre_mm},
          {"tre_mm", row.tre_mm},
          {"similarity", row.similarity},
          {"evaluations", row.evaluations},
          {"stop_reason", row.stop_reason}},
         cells);
  append(std::move(own.behind_stop_reason), cells);
  append({{"inadmissible", row.inadmissible},
          {"drr_count", row.drr_count},
          {"chain", row.chain},
          {"verdict", row.verdict}},
         cells);
  append(std::move(own.behind_verdict), cells);
  if (parts.uncertainty) {
    append(judge_cells(row.judge), cells);
    append(uncertainty_cells(row.uncertainty, row.chain_distance_mm), cells);
    append(std::move(own.behind_uncertainty), cells);
  }
  if (parts.correction) append(correction_cells(row.correction), cells);
  cells.emplace_back("seconds", row.seconds);
  return cells;
}

CsvCells correction_cells(const std::optional<CorrectionReport>& correction) {
  const CorrectionReport report = correction.value_or(CorrectionReport());
  CsvCells cells = {{"correction_casts", report.casts},
                    {"correction_moved_mm", report.moved_mm},
                    {"correction_last_mm", report.last_mm},
                    {"correction_stood_still", report.stood_still}};
  if (!correction.has_value())
    for (CsvCell& cell : cells) cell.text.clear();
  return cells;
}

CsvCells judge_cells(const JudgeSummary& judge) {
  return {{"judge_mean", judge.coarse.mean},
          {"judge_lowest_view", judge.coarse.lowest},
          {"judge_fine_mean", judge.fine.mean},
          {"judge_fine_lowest_view", judge.fine.lowest},
          {"judge_fine_background", judge.background},
          {"judge_excess", judge.excess}};
}

CsvCells uncertainty_cells(const UncertaintyReport& report, double chain_distance_mm) {
  CsvCells cells = {{"predicted_tre_rms_mm", report.tre_rms_mm},
                    {"predicted_tre_95_mm", report.tre_95_mm},
                    {"sandwich_tre_mm", report.sandwich_tre_mm},
                    {"predicted_depth_95_mm", report.depth_95_mm},
                    {"target_share", report.target.share},
                    {"target_apart_mm", report.target.apart_mm},
                    {"confidence", report.confidence},
                    {"covariance_inflation", report.inflation},
                    {"tre_inflation", report.tre_inflation},
                    {"chain_distance_mm", chain_distance_mm}};
  constexpr std::array kShortNames{"rx", "ry", "rz", "tx", "ty", "tz"};
  std::size_t next = 0;
  for (std::size_t row = 0; row < kShortNames.size(); ++row)
    for (std::size_t column = row; column < kShortNames.size(); ++column)
      cells.emplace_back(std::string("cov_") + kShortNames[row] + "_" + kShortNames[column],
                         report.covariance_deg_mm[next++]);
  return cells;
}

}  // namespace af::registration
