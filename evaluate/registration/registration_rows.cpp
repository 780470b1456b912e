// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/registration_rows.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "files/output_file.h"
#include "register/results/registration_columns.h"

namespace af::evaluation {

namespace {

void append_numbers(std::vector<std::string>& fields, const std::array<double, 6>& values) {
  for (const double value : values) fields.push_back(number_text(value));
}

/// What parts of the columns rows have.
struct RowParts {
  bool correction = false;
  bool uncertainty = false;
};

RowParts parts_of(std::span<const RegistrationRow> rows) {
  RowParts parts;
  for (const RegistrationRow& row : rows) {
    parts.correction = parts.correction || row.is_corrected;
    // Either may be missing alone.
    parts.uncertainty = parts.uncertainty || std::isfinite(row.uncertainty.confidence) ||
                        std::isfinite(row.uncertainty.covariance_deg_mm[0]);
  }
  return parts;
}

std::vector<std::string> start_columns() {
  std::vector<std::string> columns = {"case", "start_index", "interval", "draw_index"};
  for (const char* name : kParameterNames) columns.push_back(std::string("start_") + name);
  columns.emplace_back("initial_tre_mm");
  for (const char row : {'0', '1', '2'})
    for (const char column : {'0', '1', '2', '3'})
      columns.push_back(std::string("m") + row + column);
  return columns;
}

std::vector<std::string> start_fields(const std::string& case_name,
                                      std::size_t index,
                                      const PerturbedStart& start) {
  std::vector<std::string> fields = {case_name,
                                     std::to_string(index),
                                     std::to_string(start.interval),
                                     std::to_string(start.draw_index)};
  append_numbers(fields, start.parameters.deg_and_mm());
  fields.push_back(number_text(start.initial_tre_mm));
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      fields.push_back(number_text(start.room_from_ct.matrix()(row, column)));
  return fields;
}

registration::NamedCells cells_of(const RegistrationRow& row,
                                  const RowParts& parts,
                                  double success_tre_mm) {
  const registration::RegistrationCells cells = {.case_name = row.case_name,
                                                 .start_index = row.start_index,
                                                 .renderer = row.renderer,
                                                 .start_deg_mm = row.start_deg_mm,
                                                 .final_deg_mm = row.final_deg_mm,
                                                 .initial_tre_mm = row.initial_tre_mm,
                                                 .tre_mm = row.tre_mm,
                                                 .similarity = row.similarity,
                                                 .evaluations = row.evaluations,
                                                 .stop_reason = row.stop_reason,
                                                 .inadmissible = row.inadmissible,
                                                 .drr_count = row.drr_count,
                                                 .chain = row.chain,
                                                 .seconds = row.seconds};
  const RegistrationErrors& errors = row.errors;
  registration::NamedCells before_seconds = {
      {"mrpd_mm", number_text(errors.mrpd_mm)},
      {"projection_detector_mm", number_text(errors.projection_detector_mm)},
      {"projection_isocenter_mm", number_text(errors.projection_isocenter_mm)},
      {"rotation_error_deg", number_text(errors.rotation_deg)},
      {"translation_error_mm", number_text(errors.translation_mm)},
      {"error", row.error}};
  if (parts.uncertainty) {
    registration::append(registration::judge_cells(row.judge), before_seconds);
    registration::append(registration::uncertainty_cells(row.uncertainty, row.chain_distance_mm),
                         before_seconds);
    before_seconds.emplace_back("squared_distance", number_text(row.squared_distance));
  }
  if (parts.correction)
    registration::append(registration::correction_cells(
                             row.is_corrected ? std::optional(row.correction) : std::nullopt),
                         before_seconds);
  return registration::registration_row(
      cells,
      {{"success", row.is_success(success_tre_mm) ? "1" : "0"},
       {"interval", std::to_string(row.interval)},
       {"draw_index", std::to_string(row.draw_index)},
       {"stated_pose_tre_mm", number_text(row.stated_pose_tre_mm)}},
      before_seconds);
}

CsvTable table_of(std::span<const RegistrationRow> rows,
                  const RowParts& parts,
                  double success_tre_mm) {
  CsvTable table(registration::names_of(cells_of(RegistrationRow(), parts, success_tre_mm)));
  for (const RegistrationRow& row : rows)
    table.add_row(registration::texts_of(cells_of(row, parts, success_tre_mm)));
  return table;
}

}  // namespace

CsvTable registrations_table(std::span<const RegistrationRow> rows, double success_tre_mm) {
  return table_of(rows, parts_of(rows), success_tre_mm);
}

void write_registrations(const std::filesystem::path& path,
                         std::span<const RegistrationRow> rows,
                         double success_tre_mm) {
  const RowParts parts = parts_of(rows);
  write_csv_in_parts(path, rows.size(), [&](std::size_t first, std::size_t end) {
    return table_of(rows.subspan(first, end - first), parts, success_tre_mm);
  });
}

StartsFile::StartsFile(std::filesystem::path path)
    : path_(std::move(path)), partial_(path_.string() + ".partial") {
  check_output_file(path_, partial_);
  file_.open(partial_);
  file_ << CsvTable(start_columns()).to_text();
}

void StartsFile::add(const std::string& case_name, std::span<const PerturbedStart> starts) {
  for (std::size_t i = 0; i < starts.size(); ++i) {
    CsvTable row(start_columns());
    row.add_row(start_fields(case_name, i, starts[i]));
    file_ << row.rows_text();
  }
}

void StartsFile::finish() {
  file_.close();
  if (!file_)
    throw FileError(partial_.string(), std::string("cannot be written: ") + std::strerror(errno));
  move_into_place(partial_, path_);
}

}  // namespace af::evaluation
