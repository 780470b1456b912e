// SPDX-License-Identifier: Apache-2.0
#include "study/pose_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <sstream>
#include <string_view>

#include "base/error.h"
#include "files/output_file.h"
#include "text/csv_table.h"
#include "text/json_text.h"
#include "text/toml_reader.h"

namespace af {

namespace {

constexpr std::size_t kMaxPoseFileBytes = std::size_t{64} << 20;
constexpr const char* kPoseKey = "room_from_ct";

RigidTransform rigid_or_throw(const Eigen::Matrix4d& matrix, const std::string& where) {
  throw_if_any(rigidity_problems(matrix), where);
  return rigid_from_matrix(matrix);
}

/// The numbers of a text, separated by blanks, commas or brackets.
std::vector<double> numbers_of(std::string_view text, const std::string& where) {
  constexpr std::string_view kSeparators = " \t\r\n,;[]()";
  std::vector<double> numbers;
  for (std::size_t start = 0;;) {
    start = text.find_first_not_of(kSeparators, start);
    if (start == std::string_view::npos) return numbers;
    const std::size_t stop = std::min(text.find_first_of(kSeparators, start), text.size());
    std::string_view word = text.substr(start, stop - start);
    start = stop;
    if (word.starts_with('+') && !word.starts_with("+-")) word.remove_prefix(1);
    double value = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
      throw FileError(where, "pose", "finite numbers", "'" + std::string(word.substr(0, 40)) + "'");
    numbers.push_back(value);
  }
}

RigidTransform pose_of_plain_numbers(const std::string& text, const std::string& file) {
  std::string without_comments;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    without_comments += line.substr(0, line.find('#')) + "\n";
  const std::vector<double> numbers = numbers_of(without_comments, file);
  constexpr std::size_t kCount = 16;
  if (numbers.size() != kCount)
    throw FileError(
        file, "pose", "16 numbers of room_from_ct, row by row", std::to_string(numbers.size()));
  return rigid_or_throw(
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data()), file);
}

RigidTransform pose_of_json(const std::string& text, const std::string& file) {
  const nlohmann::json json = json_of_text(text, file);
  if (!json.contains(kPoseKey)) throw InputError(file + ": has no \"" + kPoseKey + "\"");
  return pose_of_rows(json[kPoseKey], file + ": " + kPoseKey);
}

RigidTransform pose_of_toml(const std::string& text, const std::string& file) {
  const toml::table table = parse_toml(text, file);
  TomlProblems problems(file);
  TomlTableReader reader(table, "", problems);
  const auto pose = reader.get_pose(kPoseKey, Presence::Required);
  problems.throw_if_any();
  check(pose.has_value(), "a pose without problems must be there");
  return *pose;
}

/// The "Key: value" lines of the one transform in an ITK transform text.
std::map<std::string, std::string> itk_fields(const std::string& text, const std::string& file) {
  std::map<std::string, std::string> fields;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line.front() == '#') continue;
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos)
      throw FileError(file, "line '" + line.substr(0, 40) + "' has no colon");
    if (!fields.emplace(line.substr(0, colon), line.substr(colon + 1)).second)
      throw FileError(file,
                      "'" + line.substr(0, colon) + "' is repeated; one transform is expected");
  }
  for (const char* key : {"Transform", "Parameters", "FixedParameters"})
    if (fields.count(key) == 0) throw FileError(file, std::string("has no '") + key + ":' line");
  return fields;
}

/// Rotation of a versor's vector part (x, y, z); its scalar part is not negative.
Eigen::Matrix3d rotation_of_versor(const Eigen::Vector3d& versor, const std::string& file) {
  const double squared_norm = versor.squaredNorm();
  constexpr double kRoundingTolerance = 1e-9;
  if (!(squared_norm <= 1.0 + kRoundingTolerance))
    throw InputError(file + ": the versor's vector part is longer than 1");
  const double scalar = std::sqrt(std::max(0.0, 1.0 - squared_norm));
  return Eigen::Quaterniond(scalar, versor.x(), versor.y(), versor.z())
      .normalized()
      .toRotationMatrix();
}

/// The linear part and translation of x' = A (x - center) + center + t, as ITK's
/// MatrixOffsetTransformBase defines them.
RigidTransform pose_of_itk_transform(const std::string& text, const std::string& file) {
  const auto fields = itk_fields(text, file);
  std::istringstream type_line(fields.at("Transform"));
  std::string type;
  type_line >> type;
  const auto parameters = numbers_of(fields.at("Parameters"), file + ": Parameters");
  const auto center = numbers_of(fields.at("FixedParameters"), file + ": FixedParameters");
  const bool is_matrix = type.starts_with("AffineTransform_") ||
                         type.starts_with("MatrixOffsetTransformBase_") ||
                         type.starts_with("Rigid3DTransform_");
  const bool is_versor = type.starts_with("VersorRigid3DTransform_");
  if (!(is_matrix || is_versor) || !type.ends_with("_3_3"))
    throw InputError(file + ": Transform",
                     type.substr(0, 60),
                     "must be AffineTransform, MatrixOffsetTransformBase, Rigid3DTransform or "
                     "VersorRigid3DTransform in three dimensions (_double_3_3)");
  const std::size_t expected = is_matrix ? 12 : 6;
  if (parameters.size() != expected)
    throw FileError(
        file, "number of Parameters", std::to_string(expected), std::to_string(parameters.size()));
  if (center.size() != 3)
    throw FileError(file, "number of FixedParameters", "3", std::to_string(center.size()));
  const Eigen::Vector3d center_point(center[0], center[1], center[2]);
  const Eigen::Vector3d translation = Eigen::Map<const Eigen::Vector3d>(&parameters[expected - 3]);
  Eigen::Matrix4d ct_from_room = Eigen::Matrix4d::Identity();
  ct_from_room.topLeftCorner<3, 3>() =
      is_matrix ? Eigen::Matrix3d(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
                      parameters.data()))
                : rotation_of_versor({parameters[0], parameters[1], parameters[2]}, file);
  ct_from_room.topRightCorner<3, 1>() =
      translation + center_point - ct_from_room.topLeftCorner<3, 3>() * center_point;
  return rigid_or_throw(ct_from_room, file).inverse();
}

std::string matrix_column(int row, int column) {
  return "m" + std::to_string(row) + std::to_string(column);
}

bool has_matrix_columns(const CsvTable& table, int rows) {
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < 4; ++column)
      if (!table.find_column(matrix_column(row, column))) return false;
  return true;
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

void check_parameter_columns(const CsvTable& table, const std::string& file) {
  std::string missing;
  for (const char* column : kParameterNames)
    if (!table.find_column(column)) missing += (missing.empty() ? "" : ", ") + std::string(column);
  if (!missing.empty())
    throw InputError(file + ":1: has no column " + missing +
                     " (wanted: rx_deg, ry_deg, rz_deg, tx_mm, ty_mm, tz_mm, or m00 ... m23)");
}

}  // namespace

RigidTransform read_pose(const std::filesystem::path& path) {
  const std::string file = path.string();
  const std::string text = read_text_file(path, kMaxPoseFileBytes);
  const std::size_t start = text.find_first_not_of(" \t\r\n");
  if (start == std::string::npos) throw FileError(file, "is empty; a pose was expected");
  if (text.compare(start, 8, "#Insight") == 0) return pose_of_itk_transform(text, file);
  if (text[start] == '{') return pose_of_json(text, file);
  if (path.extension() == ".toml" || text.find(kPoseKey) != std::string::npos)
    return pose_of_toml(text, file);
  return pose_of_plain_numbers(text, file);
}

RigidTransform pose_of_deg_and_mm(const PoseFrame& frame,
                                  const std::array<double, 6>& values,
                                  const std::string& where) {
  const RigidTransform pose = pose_from_parameters(frame, PoseParameters::from_deg_and_mm(values));
  return rigid_or_throw(pose.matrix(), where);
}

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

std::string pose_to_itk_transform(const RigidTransform& room_from_ct) {
  const RigidTransform ct_from_room = room_from_ct.inverse();
  std::string parameters;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      parameters += " " + number_text(ct_from_room.linear()(row, column));
  for (int row = 0; row < 3; ++row)
    parameters += " " + number_text(ct_from_room.translation()[row]);
  return "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
         "Parameters:" +
         parameters + "\nFixedParameters: 0 0 0\n";
}

std::vector<RigidTransform> read_poses_csv(const std::filesystem::path& path,
                                           const PoseFrame& frame) {
  const std::string file = path.string();
  const CsvTable table = CsvTable::read(path);
  if (table.row_count() == 0) throw InputError(file + ": has no poses below its header");
  // A matrix needs no frame, so it is preferred where a file has both.
  const bool has_matrix = has_matrix_columns(table, 3);
  const int matrix_rows = has_matrix_columns(table, 4) ? 4 : 3;
  if (!has_matrix) check_parameter_columns(table, file);
  std::vector<RigidTransform> poses;
  poses.reserve(table.row_count());
  for (std::size_t row = 0; row < table.row_count(); ++row)
    poses.push_back(has_matrix ? matrix_of_row(table, row, matrix_rows)
                               : parameters_of_row(table, row, frame));
  return poses;
}

}  // namespace af
