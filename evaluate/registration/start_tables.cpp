// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/start_tables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/joined.h"
#include "files/csv_table.h"
#include "study/pose_file.h"
#include "study/project_poses.h"

namespace af::evaluation {
namespace {

bool is_of_case(const CsvTable& table, std::size_t row, const PoseTableFrames& frames) {
  if (table.find_column("case").has_value()) return table.text(row, "case") == frames.case_name;
  if (frames.is_only_case) return true;
  throw InputError("case", "no such column", "is needed with several cases", table.where(row));
}

/// A number of a table; NaN where it says nan or is empty. Throws FileError for other text.
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
  return pose_of_deg_and_mm(frame, values, table.where(row));
}

/// The start to which a row belongs; nullopt when its start_index is not a whole number.
std::optional<std::int64_t> start_index_of(const CsvTable& table, std::size_t row) {
  const double value = number_or_nan(table, row, "start_index");
  // Whole numbers beyond 2^53 are not exact in a double.
  constexpr double kLargest = 9007199254740992.0;
  if (!(std::abs(value) <= kLargest) || std::trunc(value) != value) return std::nullopt;
  return static_cast<std::int64_t>(value);
}

using PoseOfRow = std::function<std::optional<RigidTransform>(std::size_t row)>;

PoseOfRow pose_reader(const CsvTable& table, const PoseTableFrames& frames) {
  if (table.find_column("m00").has_value())
    return [&](std::size_t row) { return matrix_pose(table, row); };
  if (table.find_column("final_rx_deg").has_value())
    return [&](std::size_t row) { return parameter_pose(table, row, "final_", frames.gold); };
  return [&](std::size_t row) { return parameter_pose(table, row, "", frames.nominal); };
}

double seconds_of(const CsvTable& table, std::size_t row) {
  const double seconds = number_or_nan(table, row, "seconds");
  if (seconds < 0.0)
    throw InputError(
        "seconds", table.text(row, "seconds"), "must not be negative", table.where(row));
  return seconds;
}

FoundPoses read_table(const std::filesystem::path& path, const PoseTableFrames& frames) {
  const CsvTable table = CsvTable::read(path);
  if (!table.find_column("start_index").has_value())
    throw FileError(
        path.string(), "column start_index", "the start of each pose", "no such column");
  const PoseOfRow pose_of = pose_reader(table, frames);
  const bool has_seconds = table.find_column("seconds").has_value();
  FoundPoses found;
  std::set<std::int64_t> seen;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    if (!is_of_case(table, row, frames)) continue;
    const auto report = [&](const std::string& text) {
      found.problems.push_back(table.where(row) + ": " + text);
    };
    const std::optional<std::int64_t> index = start_index_of(table, row);
    if (!index.has_value()) {
      report("start_index '" + table.text(row, "start_index") +
             "' is not a whole number; left out");
      continue;
    }
    if (!seen.insert(*index).second) {
      report("start " + std::to_string(*index) + " occurs again; the first row counts");
      continue;
    }
    const std::optional<RigidTransform> pose = pose_of(row);
    if (!pose.has_value()) {
      report("the pose of start " + std::to_string(*index) + " has values that are not finite");
      continue;
    }
    found.room_from_ct.emplace(*index, *pose);
    if (has_seconds) found.seconds.emplace(*index, seconds_of(table, row));
  }
  return found;
}

/// Case and start index of "[CASE-]INDEX". nullopt when it does not end in a number.
std::optional<std::pair<std::string, std::int64_t>> split_stem(const std::string& stem) {
  const std::size_t last = stem.find_last_not_of("0123456789");
  const std::size_t digits = last == std::string::npos ? 0 : last + 1;
  constexpr std::size_t kMostDigits = 18;
  if (digits == stem.size() || stem.size() - digits > kMostDigits) return std::nullopt;
  if (digits > 0 && stem[digits - 1] != '-') return std::nullopt;
  return std::pair(stem.substr(0, digits > 0 ? digits - 1 : 0), std::stoll(stem.substr(digits)));
}

/// Whether a file of a folder may hold poses, judging by its name.
bool is_named_like_a_pose(const std::filesystem::path& path) {
  static const std::set<std::string> extensions = {
      ".tfm", ".h5", ".dcm", ".json", ".toml", ".tra", ".txt"};  // foreign ones are refused by name
  return extensions.contains(path.extension().string());
}

/// Whether a file is a table with named columns.
bool is_table(const std::filesystem::path& path) {
  if (path.extension() == ".csv") return true;
  const PoseFileBytes file = read_pose_bytes(path);
  const std::string first_line = file.bytes.substr(0, file.bytes.find('\n'));
  return is_csv_of_poses(file) || first_line.find("start_index") != std::string::npos;
}

/// A file of poses that is not one of our tables does not name a case.
void require_only_case(const std::filesystem::path& path, const PoseTableFrames& frames) {
  if (!frames.is_only_case)
    throw InputError(path.string() +
                     ": does not say of which case its poses are; choose one with --case");
}

/// Reads such a file. Frame 1 is start 0.
FoundPoses read_frames(const std::filesystem::path& path, const PoseTableFrames& frames) {
  require_only_case(path, frames);
  const PosesInFile file = read_pose_file(path, frames.context);
  if (file.poses.empty()) throw InputError(path.string() + ": holds no pose");
  FoundPoses found;
  found.problems = file.notes;
  for (const PosesInFile::Numbered& pose : file.poses)
    found.room_from_ct.emplace(pose.number - 1, pose.room_from_ct);
  return found;
}

std::vector<std::filesystem::path> transforms_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (is_named_like_a_pose(entry.path())) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  return paths;
}

FoundPoses read_folder(const std::filesystem::path& folder, const PoseTableFrames& frames) {
  FoundPoses found;
  for (const std::filesystem::path& path : transforms_in(folder)) {
    const auto name = split_stem(path.stem().string());
    if (!name.has_value()) {
      found.problems.push_back(path.string() + ": is not named [CASE-]INDEX" +
                               path.extension().string() + "; left out");
      continue;
    }
    if (name->first.empty()) require_only_case(path, frames);
    if (!name->first.empty() && name->first != frames.case_name) continue;
    const RigidTransform pose = read_pose(path, frames.context, &found.problems);
    if (!found.room_from_ct.emplace(name->second, pose).second)
      found.problems.push_back(path.string() + ": start " + std::to_string(name->second) +
                               " occurs again; the first pose counts");
  }
  return found;
}

}  // namespace

std::vector<RigidTransform> read_starts(const std::filesystem::path& path,
                                        const PoseTableFrames& frames,
                                        std::vector<std::string>& notes) {
  if (!is_table(path)) {
    require_only_case(path, frames);
    return read_unbroken_poses(path, frames.context, &notes);
  }
  const CsvTable table = CsvTable::read(path);
  const bool has_matrix = table.find_column("m00").has_value();
  const bool has_index = table.find_column("start_index").has_value();
  std::vector<RigidTransform> poses;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    if (!is_of_case(table, row, frames)) {
      const std::string& name = table.text(row, "case");
      if (!frames.cases.contains(name))
        throw InputError("case",
                         "'" + name + "'",
                         "is not in the study, which has " + joined(frames.cases),
                         table.where(row));
      continue;
    }
    if (has_index && start_index_of(table, row) != static_cast<std::int64_t>(poses.size()))
      throw InputError("start_index",
                       table.text(row, "start_index"),
                       "must be " + std::to_string(poses.size()) +
                           ": the starts of a case stand in order, none missing or repeated",
                       table.where(row));
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

std::vector<std::string> unknown_case_problems(const std::filesystem::path& path,
                                               const std::set<std::string>& known) {
  std::map<std::string, int> poses_of;
  if (std::filesystem::is_directory(path)) {
    for (const std::filesystem::path& file : transforms_in(path))
      if (const auto name = split_stem(file.stem().string()); name.has_value())
        ++poses_of[name->first];
    poses_of.erase("");
  } else if (is_table(path)) {
    const CsvTable table = CsvTable::read(path);
    for (std::size_t row = 0; table.find_column("case").has_value() && row < table.row_count();
         ++row)
      ++poses_of[table.text(row, "case")];
  }
  std::vector<std::string> problems;
  for (const auto& [name, count] : poses_of)
    if (!known.contains(name))
      problems.push_back(path.string() + ": " + std::to_string(count) + " poses of case '" + name +
                         "', which the study does not have; left out");
  return problems;
}

FoundPoses read_found_poses(const std::filesystem::path& path, const PoseTableFrames& frames) {
  if (std::filesystem::is_directory(path)) return read_folder(path, frames);
  return is_table(path) ? read_table(path, frames) : read_frames(path, frames);
}

}  // namespace af::evaluation
