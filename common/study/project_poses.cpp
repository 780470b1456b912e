// SPDX-License-Identifier: Apache-2.0
#include "study/project_poses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"
#include "files/csv_table.h"
#include "files/json_text.h"
#include "files/toml_reader.h"
#include "study/pose_file.h"

namespace af {

namespace {

constexpr const char* kPoseKey = "room_from_ct";
constexpr const char* kStartIndex = "start_index";

/// Notes what of a file is not read. No note for an empty list.
std::vector<std::string> notes_on(const std::vector<std::string>& unread, const std::string& file) {
  if (unread.empty()) return {};
  return {file + ": not read: " + joined(unread)};
}

/// A file without a format, which result.json states, is not this project's.
std::vector<std::string> unread_keys(const nlohmann::json& json) {
  std::vector<std::string> unread;
  for (const auto& [key, value] : json.items())
    if (key != kPoseKey && !json.contains("format")) unread.push_back(key);
  return unread;
}

std::vector<std::string> unread_keys(const toml::table& table) {
  std::vector<std::string> unread;
  for (const auto& [key, value] : table)
    if (key != kPoseKey) unread.emplace_back(key.str());
  return unread;
}

PosesInFile poses_of_toml(const std::string& text, const std::string& file) {
  const toml::table table = parse_toml(text, file);
  TomlProblems problems(file);
  TomlTableReader reader(table, "", problems);
  const auto pose = reader.get_pose(kPoseKey, Presence::Required);
  problems.throw_if_any();
  check(pose.has_value(), "a pose without problems must be there");
  return {{{1, *pose}}, notes_on(unread_keys(table), file)};
}

std::string matrix_column(int row, int column) {
  return "m" + std::to_string(row) + std::to_string(column);
}

std::vector<std::string> matrix_columns(int rows) {
  std::vector<std::string> columns;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < 4; ++column) columns.push_back(matrix_column(row, column));
  return columns;
}

bool has_matrix_columns(const CsvTable& table, int rows) {
  return std::ranges::all_of(matrix_columns(rows), [&](const std::string& column) {
    return table.find_column(column).has_value();
  });
}

std::vector<std::string> unread_columns(const CsvTable& table,
                                        const std::vector<std::string>& read) {
  std::vector<std::string> unread;
  for (const std::string& column : table.columns())
    if (std::ranges::find(read, column) == read.end()) unread.push_back(column);
  return unread;
}

RigidTransform matrix_of_row(const CsvTable& table, std::size_t row, int matrix_rows) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (int i = 0; i < matrix_rows; ++i)
    for (int j = 0; j < 4; ++j) matrix(i, j) = table.number(row, matrix_column(i, j));
  return rigid_or_throw(matrix, table.where(row));
}

RigidTransform parameters_of_row(const CsvTable& table, std::size_t row, const PoseFrame& frame) {
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = table.number(row, kParameterNames[i]);
  return pose_of_deg_and_mm(frame, values, table.where(row));
}

/// A row's place, or the number that the table states where other rows are missing.
std::int64_t number_of_row(const CsvTable& table, std::size_t row) {
  if (!table.find_column(kStartIndex)) return static_cast<std::int64_t>(row + 1);
  constexpr double kMost = 1e9;
  const double index = table.number(row, kStartIndex);
  if (!(index >= 0.0 && index <= kMost) || index != std::floor(index))
    throw InputError(table.where(row) + ": " + kStartIndex,
                     table.text(row, kStartIndex),
                     "must be a whole number from 0 to 1e9");
  return static_cast<std::int64_t>(index) + 1;
}

void check_parameter_columns(const CsvTable& table, const std::string& file) {
  std::string missing;
  for (const char* column : kParameterNames)
    if (!table.find_column(column)) missing += (missing.empty() ? "" : ", ") + std::string(column);
  if (!missing.empty())
    throw InputError(file + ":1: has no column " + missing +
                     " (wanted: rx_deg, ry_deg, rz_deg, tx_mm, ty_mm, tz_mm, or m00 ... m23)");
}

}  // namespace

nlohmann::json pose_rows(const RigidTransform& pose) {
  nlohmann::json rows = nlohmann::json::array();
  for (int row = 0; row < 4; ++row) {
    nlohmann::json values = nlohmann::json::array();
    for (int column = 0; column < 4; ++column) values.push_back(pose.matrix()(row, column));
    rows.push_back(values);
  }
  return rows;
}

RigidTransform pose_of_rows(const nlohmann::json& rows, const std::string& where) {
  const auto bad_shape = [&where] {
    return InputError(where + " must be a list of 4 lists of 4 numbers");
  };
  if (!rows.is_array() || rows.size() != 4) throw bad_shape();
  Eigen::Matrix4d matrix;
  for (std::size_t i = 0; i < 4; ++i) {
    if (!rows[i].is_array() || rows[i].size() != 4) throw bad_shape();
    for (std::size_t j = 0; j < 4; ++j) {
      if (!rows[i][j].is_number()) throw bad_shape();
      matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = rows[i][j].get<double>();
    }
  }
  return rigid_or_throw(matrix, where);
}

std::string pose_to_toml(const RigidTransform& room_from_ct) {
  std::string text = std::string(kPoseKey) + " = [\n";
  for (int row = 0; row < 4; ++row)
    text += "  " + toml_numbers(room_from_ct.matrix().row(row).transpose()) + ",\n";
  return text + "]\n";
}

bool is_json_pose(const PoseFileBytes& file) {
  const std::size_t start = file.bytes.find_first_not_of(" \t\r\n");
  return start != std::string::npos && file.bytes[start] == '{';
}

PosesInFile read_json_pose(const PoseFileBytes& file, const PoseContext& /*context*/) {
  const std::string name = file.path.string();
  const nlohmann::json pose = json_of_text(file.bytes, name);
  if (!pose.contains(kPoseKey)) throw InputError(name + ": has no \"" + kPoseKey + "\"");
  return {{{1, pose_of_rows(pose[kPoseKey], name + ": " + kPoseKey)}},
          notes_on(unread_keys(pose), name)};
}

bool is_toml_pose(const PoseFileBytes& file) {
  const std::vector<std::string> lines = lines_of(file.bytes);
  return file.path.extension() == ".toml" ||
         std::ranges::any_of(lines, [](const std::string& line) {
           return line.substr(line.find_first_not_of(" \t")).starts_with(kPoseKey);
         });
}

PosesInFile read_toml_pose(const PoseFileBytes& file, const PoseContext& /*context*/) {
  return poses_of_toml(file.bytes, file.path.string());
}

bool is_csv_of_poses(const PoseFileBytes& file) {
  const std::string first_line = file.bytes.substr(0, file.bytes.find('\n'));
  return first_line.find("rx_deg") != std::string::npos ||
         first_line.find("m00") != std::string::npos;
}

PosesInFile read_csv_of_poses(const PoseFileBytes& file, const PoseContext& context) {
  const std::string name = file.path.string();
  const CsvTable table = CsvTable::read(file.path);
  if (table.row_count() == 0) throw InputError(name + ": has no poses below its header");
  // A matrix needs no frame, so it is preferred where a file has both.
  const bool has_matrix = has_matrix_columns(table, 3);
  const int matrix_rows = has_matrix_columns(table, 4) ? 4 : 3;
  if (!has_matrix) {
    check_parameter_columns(table, name);
    if (!context.frame)
      throw InputError(name +
                       ": rx_deg ... tz_mm are relative to a nominal pose, which is not known "
                       "here; give m00 ... m23 (room_from_ct) instead");
  }
  std::vector<std::string> read =
      has_matrix ? matrix_columns(matrix_rows)
                 : std::vector<std::string>(kParameterNames.begin(), kParameterNames.end());
  read.emplace_back(kStartIndex);
  PosesInFile found{{}, notes_on(unread_columns(table, read), name)};
  found.poses.reserve(table.row_count());
  for (std::size_t row = 0; row < table.row_count(); ++row)
    found.poses.push_back({number_of_row(table, row),
                           has_matrix ? matrix_of_row(table, row, matrix_rows)
                                      : parameters_of_row(table, row, *context.frame)});
  return found;
}

}  // namespace af
