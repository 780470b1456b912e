// SPDX-License-Identifier: Apache-2.0
#include "evaluate/start_pose_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "io/csv_table.h"
#include "io/pose_file.h"

namespace af::evaluation {
namespace {

constexpr std::array<const char*, 6> kParameterNames = {
    "rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm"};

bool is_of_case(const CsvTable& table, std::size_t row, const PoseTableFrames& frames) {
  if (table.find_column("case").has_value()) return table.text(row, "case") == frames.case_name;
  if (frames.is_only_case) return true;
  throw InputError("case", "no such column", "is needed with several cases", table.where(row));
}

/// A number of a table; NaN where it says nan or nothing. FileError for other text.
double number_or_nan(const CsvTable& table, std::size_t row, const std::string& column) {
  const std::string& text = table.text(row, column);
  if (text.empty() || text == "nan" || text == "NaN" || text == "-nan" || text == "inf" ||
      text == "-inf")
    return std::nan("");
  return table.number(row, column);
}

std::string matrix_column(int row, int column) {
  return "m" + std::to_string(row) + std::to_string(column);
}

std::optional<RigidTransform> matrix_pose(const CsvTable& table, std::size_t row) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) matrix(i, j) = number_or_nan(table, row, matrix_column(i, j));
  if (!matrix.allFinite()) return std::nullopt;
  const std::vector<std::string> problems = rigidity_problems(matrix);
  if (!problems.empty())
    throw InputError("room_from_ct", problems.front(), "must be rigid", table.where(row));
  return rigid_from_matrix(matrix);
}

std::optional<RigidTransform> parameter_pose(const CsvTable& table,
                                             std::size_t row,
                                             const std::string& prefix,
                                             const PoseFrame& frame) {
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = number_or_nan(table, row, prefix + kParameterNames[i]);
  if (!std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); }))
    return std::nullopt;
  return pose_from_parameters(frame, PoseParameters::from_deg_and_mm(values));
}

FoundPoses read_table(const std::filesystem::path& path, const PoseTableFrames& frames) {
  const CsvTable table = CsvTable::read(path);
  const bool has_matrix = table.find_column("m00").has_value();
  const bool has_final = table.find_column("final_rx_deg").has_value();
  if (!table.find_column("start_index").has_value())
    throw FileError(path.string(), "column start_index", "absent", "the start of each pose");
  FoundPoses found;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    if (!is_of_case(table, row, frames)) continue;
    const auto index = static_cast<std::int64_t>(table.number(row, "start_index"));
    const std::optional<RigidTransform> pose =
        has_matrix  ? matrix_pose(table, row)
        : has_final ? parameter_pose(table, row, "final_", frames.gold)
                    : parameter_pose(table, row, "", frames.nominal);
    if (!pose.has_value())
      found.problems.push_back(table.where(row) + ": the pose of start " + std::to_string(index) +
                               " has values that are not finite");
    else if (!found.room_from_ct.emplace(index, *pose).second)
      found.problems.push_back(table.where(row) + ": start " + std::to_string(index) +
                               " occurs again; the first pose counts");
    if (pose.has_value() && table.find_column("seconds").has_value())
      found.seconds.emplace(index, number_or_nan(table, row, "seconds"));
  }
  return found;
}

/// Case and start index of "[CASE-]INDEX"; nullopt when it does not end in a number.
std::optional<std::pair<std::string, std::int64_t>> split_stem(const std::string& stem) {
  const std::size_t last = stem.find_last_not_of("0123456789");
  const std::size_t digits = last == std::string::npos ? 0 : last + 1;
  constexpr std::size_t kMostDigits = 18;
  if (digits == stem.size() || stem.size() - digits > kMostDigits) return std::nullopt;
  if (digits > 0 && stem[digits - 1] != '-') return std::nullopt;
  return std::pair(stem.substr(0, digits > 0 ? digits - 1 : 0), std::stoll(stem.substr(digits)));
}

FoundPoses read_folder(const std::filesystem::path& folder, const PoseTableFrames& frames) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".tfm") paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  FoundPoses found;
  for (const std::filesystem::path& path : paths) {
    const auto name = split_stem(path.stem().string());
    if (!name.has_value()) {
      found.problems.push_back(path.string() + ": is not named [CASE-]INDEX.tfm; left out");
      continue;
    }
    const bool is_mine =
        name->first.empty() ? frames.is_only_case : name->first == frames.case_name;
    if (!is_mine) continue;
    if (!found.room_from_ct.emplace(name->second, read_pose(path)).second)
      found.problems.push_back(path.string() + ": start " + std::to_string(name->second) +
                               " occurs again; the first pose counts");
  }
  return found;
}

}  // namespace

std::vector<RigidTransform> read_starts(const std::filesystem::path& path,
                                        const PoseTableFrames& frames) {
  const CsvTable table = CsvTable::read(path);
  const bool has_matrix = table.find_column("m00").has_value();
  std::vector<RigidTransform> poses;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    if (!is_of_case(table, row, frames)) continue;
    const std::optional<RigidTransform> pose =
        has_matrix ? matrix_pose(table, row) : parameter_pose(table, row, "start_", frames.gold);
    if (!pose.has_value())
      throw InputError("start", "not finite", "a start must be a pose", table.where(row));
    poses.push_back(*pose);
  }
  if (poses.empty())
    throw InputError("case", frames.case_name, "has no start in this file", path.string());
  return poses;
}

FoundPoses read_found_poses(const std::filesystem::path& path, const PoseTableFrames& frames) {
  return std::filesystem::is_directory(path) ? read_folder(path, frames) : read_table(path, frames);
}

}  // namespace af::evaluation
