// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>

#include "evaluate/simulate/solid.h"

namespace af {

/// A part of a line inside a body, as parameters along the line, mm.
struct Chord {
  double first_mm;
  double last_mm;
};

inline constexpr Chord kWholeLine{-std::numeric_limits<double>::infinity(),
                                  std::numeric_limits<double>::infinity()};

/// Up to two chords, because a body with a waist is not convex.
struct Chords {
  std::array<Chord, 2> items{};
  int count = 0;

  void add(double first_mm, double last_mm);
  [[nodiscard]] const Chord* begin() const { return items.data(); }
  [[nodiscard]] const Chord* end() const { return items.data() + count; }
};

/// Where the line origin + t direction (unit) is inside a body. A tangent has no chord. Outside the
/// part `wanted` of the line, chords may be missing or end elsewhere.
Chords chords(const Solid& solid,
              const Eigen::Vector3d& origin,
              const Eigen::Vector3d& direction,
              const Chord& wanted = kWholeLine);

/// How a body lies relative to all points within a distance of a segment.
enum class Place {
  Off,     ///< holds none of them
  Around,  ///< holds all
  Near,    ///< neither for certain
};

/// The place relative to the segment from `from` to `to` (ct, mm).
/// \test PlaceOf.IsThatOfTheTubesPoints
Place place_of(const Solid& solid,
               const Eigen::Vector3d& from,
               const Eigen::Vector3d& to,
               double distance_mm);

}  // namespace af
