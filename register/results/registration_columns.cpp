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
  cells.insert(cells.end(), behind_stop_reason.begin(), behind_stop_reason.end());
  cells.emplace_back("inadmissible", std::to_string(row.inadmissible));
  cells.emplace_back("drr_count", std::to_string(row.drr_count));
  cells.insert(cells.end(), before_seconds.begin(), before_seconds.end());
  cells.emplace_back("seconds", number_text(row.seconds));
  return cells;
}

std::vector<std::string> names_of(const NamedCells& cells) {
  std::vector<std::string> names;
  for (const auto& [name, text] : cells) names.emplace_back(name);
  return names;
}

std::vector<std::string> texts_of(NamedCells cells) {
  std::vector<std::string> texts;
  texts.reserve(cells.size());
  for (auto& [name, text] : cells) texts.push_back(std::move(text));
  return texts;
}

}  // namespace af::registration
