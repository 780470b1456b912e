// SPDX-License-Identifier: Apache-2.0
#include "register/results/registration_columns.h"

#include "base/number_text.h"
#include "geometry/rigid_transform.h"

namespace af::registration {

namespace {

std::array<std::string, 6> parameter_columns(const std::string& prefix) {
  std::array<std::string, 6> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = prefix + kParameterNames[i];
  return names;
}

void append_parameters(NamedCells& cells,
                       const std::array<std::string, 6>& names,
                       const std::array<double, 6>& values) {
  for (std::size_t i = 0; i < names.size(); ++i)
    cells.emplace_back(names[i], number_text(values[i]));
}

}  // namespace

NamedCells registration_row(const RegistrationCells& row,
                            const NamedCells& behind_stop_reason,
                            const NamedCells& before_seconds) {
  static const std::array<std::string, 6> start_names = parameter_columns("start_");
  static const std::array<std::string, 6> final_names = parameter_columns("final_");
  NamedCells cells = {{"case", row.case_name},
                      {"start_index", std::to_string(row.start_index)},
                      {"renderer", row.renderer}};
  append_parameters(cells, start_names, row.start_deg_mm);
  append_parameters(cells, final_names, row.final_deg_mm);
  cells.emplace_back("initial_tre_mm", number_text(row.initial_tre_mm));
  cells.emplace_back("tre_mm", number_text(row.tre_mm));
  cells.emplace_back("similarity", number_text(row.similarity));
  cells.emplace_back("evaluations", std::to_string(row.evaluations));
  cells.emplace_back("stop_reason", row.stop_reason);
  append(behind_stop_reason, cells);
  cells.emplace_back("inadmissible", std::to_string(row.inadmissible));
  cells.emplace_back("drr_count", std::to_string(row.drr_count));
  cells.emplace_back("chain", row.chain);
  append(before_seconds, cells);
  cells.emplace_back("seconds", number_text(row.seconds));
  return cells;
}

NamedCells correction_cells(const std::optional<CorrectionReport>& correction) {
  const CorrectionReport report = correction.value_or(CorrectionReport());
  NamedCells cells = {{"correction_casts", std::to_string(report.casts)},
                      {"correction_moved_mm", number_text(report.moved_mm)},
                      {"correction_last_mm", number_text(report.last_mm)},
                      {"correction_stood_still", report.stood_still ? "1" : "0"}};
  if (!correction.has_value())
    for (auto& [name, text] : cells) text.clear();
  return cells;
}

NamedCells judge_cells(const JudgeSummary& judge) {
  return {{"judge_mean", number_text(judge.coarse.mean)},
          {"judge_lowest_view", number_text(judge.coarse.lowest)},
          {"judge_fine_mean", number_text(judge.fine.mean)},
          {"judge_fine_lowest_view", number_text(judge.fine.lowest)},
          {"judge_fine_background", number_text(judge.background)},
          {"judge_excess", number_text(judge.excess)}};
}

NamedCells uncertainty_cells(const UncertaintyReport& report, double chain_distance_mm) {
  static const std::array<std::string, UncertaintyReport::kCovarianceSize> names = [] {
    constexpr std::array kShortNames{"rx", "ry", "rz", "tx", "ty", "tz"};
    std::array<std::string, UncertaintyReport::kCovarianceSize> result;
    std::size_t next = 0;
    for (std::size_t row = 0; row < kShortNames.size(); ++row)
      for (std::size_t column = row; column < kShortNames.size(); ++column)
        result[next++] = std::string("cov_") + kShortNames[row] + "_" + kShortNames[column];
    return result;
  }();
  NamedCells cells = {{"predicted_tre_rms_mm", number_text(report.tre_rms_mm)},
                      {"predicted_tre_95_mm", number_text(report.tre_95_mm)},
                      {"confidence", number_text(report.confidence)},
                      {"covariance_inflation", number_text(report.inflation)},
                      {"tre_inflation", number_text(report.tre_inflation)},
                      {"chain_distance_mm", number_text(chain_distance_mm)}};
  for (std::size_t i = 0; i < names.size(); ++i)
    cells.emplace_back(names[i], number_text(report.covariance_deg_mm[i]));
  return cells;
}

void append(const NamedCells& more, NamedCells& cells) {
  cells.insert(cells.end(), more.begin(), more.end());
}

std::vector<std::string> names_of(const NamedCells& cells) {
  std::vector<std::string> names;
  for (const auto& [name, text] : cells) names.emplace_back(name);
  return names;
}

std::vector<std::string> texts_of(NamedCells cells) {
  std::vector<std::string> texts;
  texts.reserve(cells.size());
  for (auto& cell : cells) texts.push_back(std::move(cell.second));
  return texts;
}

}  // namespace af::registration
