// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "geometry/motion_range.h"

namespace af::registration {

/// Equal steps from one number to another, at most so wide; where they are equal, that number.
struct Steps {
  double first = 0.0;
  double step = 0.0;
  int count = 1;

  Steps(double low, double high, double widest);
  [[nodiscard]] double at(int i) const { return first + i * step; }
  [[nodiscard]] int nearest(double value) const;
  /// Whether the first or the last of three or more is the nearest.
  [[nodiscard]] bool is_at_end(double value) const;
};

/// A box of a lattice's nodes.
struct LatticePart {
  std::array<int, 3> first;  ///< along x, y, z
  std::array<int, 3> count;
};

/// Translations (room, mm) on a lattice over a range, x fastest.
struct TranslationLattice {
  std::array<Steps, 3> axes;

  /// InputError for more than four million translations.
  TranslationLattice(const MotionRange& range, double step_mm);

  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] Eigen::Vector3d translation(std::size_t index) const;
  [[nodiscard]] Eigen::Vector3d middle() const;
  [[nodiscard]] LatticePart whole() const;
  /// The nodes no farther than `reach_mm` from the node nearest to a translation, along each axis.
  [[nodiscard]] LatticePart around(const Eigen::Vector3d& translation, double reach_mm) const;
  /// Indices of a part's nodes, x fastest.
  [[nodiscard]] std::vector<std::size_t> nodes(const LatticePart& part) const;
};

/// Which of a part's values no neighbour along an axis exceeds, in ascending order.
std::vector<std::size_t> maxima(std::span<const float> values, const LatticePart& part);

}  // namespace af::registration
