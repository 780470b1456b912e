// SPDX-License-Identifier: Apache-2.0
#include "study/pose_file.h"

#include <algorithm>
#include <optional>
#include <sstream>

#include "base/error.h"
#include "base/parsed_number.h"
#include "base/toml_text.h"
#include "files/foreign_file.h"
#include "files/output_file.h"
#include "study/itk_transform.h"
#include "study/project_poses.h"

namespace af {
namespace {

constexpr std::array kPoseFormats = {
    PoseFormat{"itk", is_itk_text, read_itk_text},
    PoseFormat{"json", is_json_pose, read_json_pose},
    PoseFormat{"toml", is_toml_pose, read_toml_pose},
    PoseFormat{"csv", is_csv_of_poses, read_csv_of_poses},
};

/// With at least one pose; its notes are passed on.
PosesInFile filled_pose_file(const std::filesystem::path& path,
                             const PoseContext& context,
                             std::vector<std::string>* notes) {
  PosesInFile found = read_pose_file(path, context);
  if (found.poses.empty()) throw InputError(path.string() + ": holds no pose");
  if (notes != nullptr) notes->insert(notes->end(), found.notes.begin(), found.notes.end());
  return found;
}

std::vector<RigidTransform> poses_of(const PosesInFile& file) {
  std::vector<RigidTransform> poses;
  for (const PosesInFile::Numbered& pose : file.poses) poses.push_back(pose.room_from_ct);
  return poses;
}

}  // namespace

std::vector<double> numbers_of(std::string_view text, const std::string& where) {
  constexpr std::string_view kSeparators = " \t\r\n,;[]()";
  constexpr std::size_t kMostBytes = 40;  // of a word in the message
  std::vector<double> numbers;
  for (std::size_t start = 0;;) {
    start = text.find_first_not_of(kSeparators, start);
    if (start == std::string_view::npos) return numbers;
    const std::size_t stop = std::min(text.find_first_of(kSeparators, start), text.size());
    const std::string_view word = text.substr(start, stop - start);
    start = stop;
    const std::optional<double> value = finite_number(word);
    if (!value)
      throw FileError(where, "pose", "finite numbers", "'" + beginning_of(word, kMostBytes) + "'");
    numbers.push_back(*value);
  }
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.find_first_not_of(" \t") != std::string::npos) lines.push_back(line);
  }
  return lines;
}

const PoseFormat& format_of_pose_file(const PoseFileBytes& file, const PoseContext& context) {
  if (!has_foreign_mark(file.bytes))
    for (const PoseFormat& format : kPoseFormats)
      if (format.is_it(file)) return format;
  throw needs_conversion({&file.path, 1},
                         "holds no pose as TOML, CSV, JSON or ITK's text",
                         context.conversion_options,
                         "poses.csv");
}

PoseFileBytes read_pose_bytes(const std::filesystem::path& path) {
  constexpr std::size_t kMaxPoseFileBytes = std::size_t{64} << 20;
  PoseFileBytes file{path, read_text_file(path, kMaxPoseFileBytes)};
  if (file.bytes.find_first_not_of(" \t\r\n") == std::string::npos)
    throw FileError(path.string(), "is empty; a pose was expected");
  return file;
}

PosesInFile read_pose_file(const std::filesystem::path& path, const PoseContext& context) {
  const PoseFileBytes file = read_pose_bytes(path);
  return format_of_pose_file(file, context).read(file, context);
}

std::vector<RigidTransform> read_poses(const std::filesystem::path& path,
                                       const PoseContext& context,
                                       std::vector<std::string>* notes) {
  return poses_of(filled_pose_file(path, context, notes));
}

std::vector<RigidTransform> read_unbroken_poses(const std::filesystem::path& path,
                                                const PoseContext& context,
                                                std::vector<std::string>* notes) {
  const PosesInFile found = filled_pose_file(path, context, notes);
  for (std::size_t i = 0; i < found.poses.size(); ++i)
    if (found.poses[i].number != static_cast<std::int64_t>(i) + 1)
      throw InputError(
          "frame " + std::to_string(i + 1),
          "no pose",
          "starts are numbered by their frames, so each needs one: leave the frame out "
          "of the file, or complete it",
          path.string());
  return poses_of(found);
}

RigidTransform read_pose(const std::filesystem::path& path,
                         const PoseContext& context,
                         std::vector<std::string>* notes) {
  const std::vector<RigidTransform> poses = read_poses(path, context, notes);
  if (poses.size() > 1)
    throw InputError(path.string() + ": holds " + std::to_string(poses.size()) +
                     " poses; one is expected");
  return poses.front();
}

}  // namespace af
