// SPDX-License-Identifier: Apache-2.0
#include "pose_files/autoscoper_pose.h"

#include <algorithm>
#include <span>
#include <sstream>

#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"

namespace af {
namespace {

constexpr std::size_t kNumbers = 16;

std::vector<std::string> words_of(std::string line) {
  std::replace(line.begin(), line.end(), ',', ' ');
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; words.size() <= kNumbers && stream >> word;) words.push_back(word);
  return words;
}

bool is_nan_word(const std::string& word) {
  return word == "NaN" || word == "nan" || word == "NAN" || word == "-nan" || word == "-NaN";
}

/// "2, 5, 9 and 4 more".
std::string first_of(const std::vector<std::int64_t>& frames) {
  constexpr std::size_t kShown = 8;
  const std::size_t shown = std::min(kShown, frames.size());
  std::string text = joined(std::span(frames).first(shown), ", ", [](std::int64_t frame) {
    return std::to_string(frame);
  });
  if (frames.size() > shown) text += " and " + std::to_string(frames.size() - shown) + " more";
  return text;
}

CtGrid grid_of(const PoseContext& context, const std::string& file) {
  if (!context.ct_grid)
    throw InputError(
        file + ": an Autoscoper pose is in the CT's voxel frame; give the CT (--ct, or --study)");
  return context.ct_grid();
}

}  // namespace

RigidTransform ct_from_autoscoper_volume(const CtGrid& grid) {
  if (!(grid.direction.determinant() > 0.0))
    throw InputError("direction of the CT's axes",
                     "left-handed",
                     "must be right-handed for Autoscoper's volume frame");
  RigidTransform ct_from_volume = RigidTransform::Identity();
  ct_from_volume.linear() = grid.direction * Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  ct_from_volume.translation() = grid.point_mm({-0.5, grid.size[1] - 0.5, -0.5});
  return ct_from_volume;
}

bool is_autoscoper(const PoseFileBytes& file) {
  const std::vector<std::string> lines = lines_of(file.bytes);
  // One line of 16 numbers may also be a plain 4x4 matrix: then the name decides.
  if (lines.empty() || (lines.size() == 1 && file.path.extension() != ".tra")) return false;
  return std::ranges::all_of(lines, [](const std::string& line) {
    const std::vector<std::string> words = words_of(line);
    return words.size() == kNumbers &&
           line.find_first_not_of("0123456789+-.eEnaNA, \t") == std::string::npos;
  });
}

PosesInFile read_autoscoper(const PoseFileBytes& file, const PoseContext& context) {
  const std::string name = file.path.string();
  const RigidTransform volume_from_ct = ct_from_autoscoper_volume(grid_of(context, name)).inverse();
  PosesInFile found;
  std::vector<std::int64_t> untracked;
  const std::vector<std::string> lines = lines_of(file.bytes);
  for (std::size_t frame = 1; frame <= lines.size(); ++frame) {
    const std::vector<std::string> words = words_of(lines[frame - 1]);
    const std::string where = name + ": frame " + std::to_string(frame);
    if (words.size() == kNumbers && std::ranges::all_of(words, is_nan_word)) {
      untracked.push_back(static_cast<std::int64_t>(frame));
      continue;
    }
    const std::vector<double> numbers = numbers_of(lines[frame - 1], where);
    if (numbers.size() != kNumbers)
      throw FileError(where, "numbers of room_from_volume", "16", std::to_string(numbers.size()));
    const RigidTransform room_from_volume = rigid_or_throw(
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data()), where);
    found.poses.push_back({static_cast<std::int64_t>(frame), room_from_volume * volume_from_ct});
  }
  if (!untracked.empty())
    found.notes.push_back(
        name + ": " + std::to_string(untracked.size()) + " of " + std::to_string(lines.size()) +
        " frames were not tracked (NaN) and are left out: " + first_of(untracked));
  return found;
}

std::string write_autoscoper(std::span<const RigidTransform> room_from_ct,
                             const PoseContext& context) {
  const RigidTransform ct_from_volume = ct_from_autoscoper_volume(grid_of(context, "autoscoper"));
  std::string text;
  for (const RigidTransform& pose : room_from_ct) {
    const Eigen::Matrix4d matrix = (pose * ct_from_volume).matrix();
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column)
        text += (row + column == 0 ? "" : ",") + number_text(matrix(row, column));
    text += "\n";
  }
  return text;
}

}  // namespace af
