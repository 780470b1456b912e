// SPDX-License-Identifier: Apache-2.0
#include "figures/patient_directions.h"

#include <algorithm>
#include <cmath>

namespace af {

std::string patient_letters(const Eigen::Vector3d& ct_direction) {
  const Eigen::Vector3d direction = ct_direction.normalized();
  constexpr std::array<const char*, 3> kPositive = {"L", "P", "H"};
  constexpr std::array<const char*, 3> kNegative = {"R", "A", "F"};
  std::array<int, 3> order = {0, 1, 2};
  std::ranges::stable_sort(
      order, [&](int a, int b) { return std::abs(direction[a]) > std::abs(direction[b]); });
  const double least = std::cos(67.5 * kRadPerDeg);
  std::string letters;
  for (const int axis : order) {
    if (!letters.empty() && std::abs(direction[axis]) < least) break;
    const auto index = static_cast<std::size_t>(axis);
    letters += direction[axis] > 0.0 ? kPositive[index] : kNegative[index];
  }
  return letters;
}

EdgeLetters edge_letters(const CameraGeometry& camera, const RigidTransform& room_from_ct) {
  const Eigen::Matrix3d ct_from_room = room_from_ct.linear().transpose();
  const auto letters = [&](const Eigen::Vector3d& room_direction) {
    return patient_letters(ct_from_room * room_direction);
  };
  return {letters(-camera.column_direction),
          letters(camera.column_direction),
          letters(-camera.row_direction),
          letters(camera.row_direction),
          letters(-camera.beam_direction()),
          letters(camera.beam_direction())};
}

void add_letters(const EdgeLetters& letters, const RegionOfInterest& part, PicturePanel& panel) {
  const double inset = 0.05 * std::max(part.width, part.height);
  const auto add = [&](double x, double y, const std::string& text) {
    panel.marks.push_back(
        {{part.column + x, part.row + y}, PictureMark::Shape::None, text, PictureColor::Yellow});
  };
  add(inset, part.height / 2.0, letters.left);
  add(part.width - inset, part.height / 2.0, letters.right);
  add(part.width / 2.0, inset, letters.top);
  add(part.width / 2.0, part.height - inset, letters.bottom);
}

}  // namespace af
