// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "evaluate/simulate/solid.h"

namespace af {

/// A part of a line inside a body: parameters along it, mm.
struct Chord {
  double first_mm;
  double last_mm;
};

/// Up to two chords: a body with a waist is not convex.
struct Chords {
  std::array<Chord, 2> items{};
  int count = 0;

  void add(double first_mm, double last_mm);
  [[nodiscard]] const Chord* begin() const { return items.data(); }
  [[nodiscard]] const Chord* end() const { return items.data() + count; }
};

/// Where the line origin + t direction (unit) is inside a body; a tangent has none.
Chords chords(const Solid& solid, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction);

}  // namespace af
