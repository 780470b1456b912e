// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/registration_rows.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "files/csv_cells.h"
#include "files/output_file.h"

namespace af::evaluation {

namespace {

using registration::RowParts;

RowParts parts_of(std::span<const RegistrationRow> rows) {
  RowParts parts;
  for (const RegistrationRow& row : rows) {
    parts.correction = parts.correction || row.correction.has_value();
    // Either may be missing alone.
    parts.uncertainty = parts.uncertainty || std::isfinite(row.uncertainty.confidence) ||
                        std::isfinite(row.uncertainty.covariance_deg_mm[0]);
  }
  return parts;
}

CsvCells start_cells(const std::string& case_name, std::size_t index, const PerturbedStart& start) {
  CsvCells cells = {{"case", case_name},
                    {"start_index", index},
                    {"interval", start.interval},
                    {"draw_index", start.draw_index}};
  append("start_", kParameterNames, start.parameters.deg_and_mm(), cells);
  cells.emplace_back("initial_tre_mm", start.initial_tre_mm);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      cells.emplace_back("m" + std::to_string(row) + std::to_string(column),
                         start.room_from_ct.matrix()(row, column));
  return cells;
}

CsvCells cells_of(const RegistrationRow& row, const RowParts& parts, double success_tre_mm) {
  const RegistrationErrors& errors = row.errors;
  return registration_cells(row,
                            parts,
                            {{{"success", row.is_success(success_tre_mm)},
                              {"interval", row.interval},
                              {"draw_index", row.draw_index},
                              {"stated_pose_tre_mm", row.stated_pose_tre_mm}},
                             {{"mrpd_mm", errors.mrpd_mm},
                              {"projection_detector_mm", errors.projection_detector_mm},
                              {"projection_isocenter_mm", errors.projection_isocenter_mm},
                              {"rotation_error_deg", errors.rotation_deg},
                              {"translation_error_mm", errors.translation_mm},
                              {"depth_mm", errors.depth_mm},
                              {"error", row.error}},
                             {{"squared_distance", row.squared_distance}}});
}

CsvTable table_of(std::span<const RegistrationRow> rows,
                  const RowParts& parts,
                  double success_tre_mm) {
  return csv_table(
      rows, [&](const RegistrationRow& row) { return cells_of(row, parts, success_tre_mm); });
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
  file_ << CsvTable(columns_of(start_cells({}, 0, {}))).to_text();
}

void StartsFile::add(const std::string& case_name, std::span<const PerturbedStart> starts) {
  for (std::size_t i = 0; i < starts.size(); ++i)
    file_ << csv_table({start_cells(case_name, i, starts[i])}).rows_text();
}

void StartsFile::finish() {
  file_.close();
  if (!file_)
    throw FileError(partial_.string(), std::string("cannot be written: ") + std::strerror(errno));
  move_into_place(partial_, path_);
}

}  // namespace af::evaluation
