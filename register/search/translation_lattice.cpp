// SPDX-License-Identifier: Apache-2.0
#include "register/search/translation_lattice.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace af::registration {
namespace {

/// Each view's places of the lattice take 20 bytes a translation.
constexpr double kMostTranslations = 4e6;

}  // namespace

Steps::Steps(double low, double high, double widest)
    : count(std::max(1, 1 + static_cast<int>(std::ceil((high - low) / widest - 1e-9)))) {
  step = count > 1 ? (high - low) / (count - 1) : 0.0;
  first = count > 1 ? low : 0.5 * (low + high);
}

int Steps::nearest(double value) const {
  if (count == 1) return 0;
  return static_cast<int>(std::lround(std::clamp((value - first) / step, 0.0, count - 1.0)));
}

bool Steps::is_at_end(double value) const {
  return count > 2 && (nearest(value) == 0 || nearest(value) == count - 1);
}

TranslationLattice::TranslationLattice(const MotionRange& range, double step_mm)
    : axes{Steps(range.low.translation_mm.x(), range.high.translation_mm.x(), step_mm),
           Steps(range.low.translation_mm.y(), range.high.translation_mm.y(), step_mm),
           Steps(range.low.translation_mm.z(), range.high.translation_mm.z(), step_mm)} {
  const double count = static_cast<double>(axes[0].count) * axes[1].count * axes[2].count;
  if (count > kMostTranslations)
    throw InputError("search range",
                     range.text(),
                     "must have at most four million translations, a coarse pixel apart");
}

std::size_t TranslationLattice::size() const {
  return static_cast<std::size_t>(axes[0].count) * static_cast<std::size_t>(axes[1].count) *
         static_cast<std::size_t>(axes[2].count);
}

Eigen::Vector3d TranslationLattice::translation(std::size_t index) const {
  const auto columns = static_cast<std::size_t>(axes[0].count);
  const auto rows = static_cast<std::size_t>(axes[1].count);
  return {axes[0].at(static_cast<int>(index % columns)),
          axes[1].at(static_cast<int>(index / columns % rows)),
          axes[2].at(static_cast<int>(index / (columns * rows)))};
}

Eigen::Vector3d TranslationLattice::middle() const {
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    const Steps& steps = axes[static_cast<std::size_t>(axis)];
    middle[axis] = 0.5 * (steps.at(0) + steps.at(steps.count - 1));
  }
  return middle;
}

LatticePart TranslationLattice::whole() const {
  return {{0, 0, 0}, {axes[0].count, axes[1].count, axes[2].count}};
}

LatticePart TranslationLattice::around(const Eigen::Vector3d& translation, double reach_mm) const {
  LatticePart part{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Steps& steps = axes[axis];
    const int at = steps.nearest(translation[static_cast<Eigen::Index>(axis)]);
    const int reach =
        steps.count > 1 ? static_cast<int>(std::floor(reach_mm / steps.step + 1e-9)) : 0;
    part.first[axis] = std::max(0, at - reach);
    part.count[axis] = std::min(steps.count - 1, at + reach) - part.first[axis] + 1;
  }
  return part;
}

std::vector<std::size_t> TranslationLattice::nodes(const LatticePart& part) const {
  const auto columns = static_cast<std::size_t>(axes[0].count);
  const auto rows = static_cast<std::size_t>(axes[1].count);
  std::vector<std::size_t> nodes;
  for (int z = part.first[2]; z < part.first[2] + part.count[2]; ++z)
    for (int y = part.first[1]; y < part.first[1] + part.count[1]; ++y)
      for (int x = part.first[0]; x < part.first[0] + part.count[0]; ++x)
        nodes.push_back((static_cast<std::size_t>(z) * rows + static_cast<std::size_t>(y)) *
                            columns +
                        static_cast<std::size_t>(x));
  return nodes;
}

std::vector<std::size_t> maxima(std::span<const float> values, const LatticePart& part) {
  const auto& [columns, rows, layers] = part.count;
  const auto row = static_cast<std::size_t>(columns);
  const std::size_t layer = row * static_cast<std::size_t>(rows);
  std::vector<std::size_t> found;
  std::size_t i = 0;
  for (int z = 0; z < layers; ++z)
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x, ++i) {
        const float value = values[i];
        if ((x > 0 && values[i - 1] > value) || (x + 1 < columns && values[i + 1] > value) ||
            (y > 0 && values[i - row] > value) || (y + 1 < rows && values[i + row] > value) ||
            (z > 0 && values[i - layer] > value) || (z + 1 < layers && values[i + layer] > value))
          continue;
        found.push_back(i);
      }
  return found;
}

}  // namespace af::registration
