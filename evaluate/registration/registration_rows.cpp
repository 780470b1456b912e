// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/registration_rows.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "files/output_file.h"
#include "register/results/registration_columns.h"
#include "text/cbor_json.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

void append_numbers(std::vector<std::string>& fields, const std::array<double, 6>& values) {
  for (const double value : values) fields.push_back(number_text(value));
}

json packed_trace(const std::vector<TracePoint>& trace) {
  json packed = json::array();
  for (const TracePoint& point : trace)
    packed.push_back({point.stage,
                      point.step_mm,
                      point.poses_tried,
                      point.similarity,
                      point.deg_mm,
                      point.tre_mm});
  return packed;
}

/// get() does not check this: that a number is whole and fits.
template <typename Integer>
Integer integer_of(const json& value) {
  const bool fits =
      value.is_number_unsigned()
          ? std::in_range<Integer>(value.get<std::uint64_t>())
          : value.is_number_integer() && std::in_range<Integer>(value.get<std::int64_t>());
  if (!fits) throw std::runtime_error("a number that must be whole is not, or is too large");
  return value.get<Integer>();
}

std::vector<TracePoint> trace_of(const json& packed) {
  std::vector<TracePoint> trace;
  for (const json& point : packed)
    trace.push_back({integer_of<int>(point.at(0)),
                     point.at(1).get<double>(),
                     integer_of<std::int64_t>(point.at(2)),
                     point.at(3).get<double>(),
                     point.at(4).get<std::array<double, 6>>(),
                     point.at(5).get<double>()});
  return trace;
}

/// null: none was wanted.
json packed_correction(const RegistrationRow& row) {
  if (!row.is_corrected) return nullptr;
  const registration::CorrectionReport& report = row.correction;
  return {report.casts,
          {report.moved_mm, report.last_mm, report.defect_rms, report.defect_change},
          report.stood_still};
}

registration::CorrectionReport correction_of(const json& packed) {
  const auto values = packed.at(1).get<std::array<double, 4>>();
  return {integer_of<int>(packed.at(0)),
          values[0],
          values[1],
          values[2],
          values[3],
          packed.at(2).get<bool>()};
}

bool is_any_corrected(std::span<const RegistrationRow> rows) {
  return std::any_of(
      rows.begin(), rows.end(), [](const RegistrationRow& row) { return row.is_corrected; });
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

registration::NamedCells cells_of(const RegistrationRow& row, bool with_correction) {
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
                                                 .seconds = row.seconds};
  const RegistrationErrors& errors = row.errors;
  registration::NamedCells before_seconds = {
      {"mrpd_mm", number_text(errors.mrpd_mm)},
      {"projection_detector_mm", number_text(errors.projection_detector_mm)},
      {"projection_isocenter_mm", number_text(errors.projection_isocenter_mm)},
      {"rotation_error_deg", number_text(errors.rotation_deg)},
      {"translation_error_mm", number_text(errors.translation_mm)},
      {"error", row.error}};
  if (with_correction)
    registration::append(registration::correction_cells(
                             row.is_corrected ? std::optional(row.correction) : std::nullopt),
                         before_seconds);
  return registration::registration_row(
      cells,
      {{"success", row.is_success() ? "1" : "0"},
       {"interval", std::to_string(row.interval)},
       {"draw_index", std::to_string(row.draw_index)},
       {"stated_pose_tre_mm", number_text(row.stated_pose_tre_mm)}},
      before_seconds);
}

CsvTable table_of(std::span<const RegistrationRow> rows, bool with_correction) {
  CsvTable table(registration::names_of(cells_of(RegistrationRow(), with_correction)));
  for (const RegistrationRow& row : rows)
    table.add_row(registration::texts_of(cells_of(row, with_correction)));
  return table;
}

}  // namespace

json packed_row(const TracedRow& traced) {
  const RegistrationRow& row = traced.row;
  return {row.case_name.text(),
          row.renderer.text(),
          row.start_index,
          row.draw_index,
          row.interval,
          row.start_deg_mm,
          row.final_deg_mm,
          {row.initial_tre_mm, row.tre_mm, row.stated_pose_tre_mm, row.similarity, row.seconds},
          row.errors.values(),
          {row.evaluations, row.inadmissible, row.drr_count},
          row.stop_reason.text(),
          row.error.text(),
          packed_trace(traced.trace),
          packed_correction(row)};
}

TracedRow row_of(const json& packed) {
  TracedRow traced;
  RegistrationRow& row = traced.row;
  row.case_name = packed.at(0).get<std::string>();
  row.renderer = packed.at(1).get<std::string>();
  row.start_index = integer_of<std::int64_t>(packed.at(2));
  row.draw_index = integer_of<std::uint64_t>(packed.at(3));
  row.interval = integer_of<int>(packed.at(4));
  row.start_deg_mm = packed.at(5).get<std::array<double, 6>>();
  row.final_deg_mm = packed.at(6).get<std::array<double, 6>>();
  const auto values = packed.at(7).get<std::array<double, 5>>();
  row.initial_tre_mm = values[0];
  row.tre_mm = values[1];
  row.stated_pose_tre_mm = values[2];
  row.similarity = values[3];
  row.seconds = values[4];
  row.errors = RegistrationErrors::of_values(packed.at(8).get<std::array<double, 5>>());
  row.evaluations = integer_of<std::int64_t>(packed.at(9).at(0));
  row.inadmissible = integer_of<std::int64_t>(packed.at(9).at(1));
  row.drr_count = integer_of<std::int64_t>(packed.at(9).at(2));
  row.stop_reason = packed.at(10).get<std::string>();
  row.error = packed.at(11).get<std::string>();
  traced.trace = trace_of(packed.at(12));
  if (const json& correction = packed.at(13); !correction.is_null()) {
    row.is_corrected = true;
    row.correction = correction_of(correction);
  }
  return traced;
}

TracedRow row_of_record(std::span<const std::byte> record, const std::string& file) {
  const json packed = json_of_cbor(record, file);
  try {
    return row_of(packed);
  } catch (const std::exception& error) {
    throw FileError(file, std::string("a record is no row: ") + error.what());
  }
}

CsvTable registrations_table(std::span<const RegistrationRow> rows) {
  return table_of(rows, is_any_corrected(rows));
}

void write_registrations(const std::filesystem::path& path, std::span<const RegistrationRow> rows) {
  const bool with_correction = is_any_corrected(rows);
  write_csv_in_parts(path, rows.size(), [&](std::size_t first, std::size_t end) {
    return table_of(rows.subspan(first, end - first), with_correction);
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

std::vector<TreOutcome> outcomes_of(std::span<const RegistrationRow> rows,
                                    const std::string& renderer) {
  std::vector<TreOutcome> outcomes;
  for (const RegistrationRow& row : rows)
    if (row.renderer == renderer) outcomes.push_back({row.initial_tre_mm, row.tre_mm});
  return outcomes;
}

}  // namespace af::evaluation
