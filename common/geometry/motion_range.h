// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <string>
#include <vector>

#include "base/hash_random.h"
#include "geometry/rigid_transform.h"

namespace af {

/// Some of the six parameters of a pose, in the order of kParameterNames.
using ParameterSet = std::bitset<6>;
/// "rx, rz, tx"
std::string parameter_names(const ParameterSet& parameters);

/// The motion box of a field: bounds of each angle and each translation relative to its PoseFrame.
/// The box need not hold the nominal pose, zero.
struct MotionRange {
  PoseParameters low;
  PoseParameters high;

  MotionRange() : MotionRange(10.0 * kRadPerDeg, 100.0) {}
  /// The same bound on both sides of zero for every axis.
  MotionRange(double max_rotation_rad, double max_translation_mm);
  MotionRange(const PoseParameters& lowest, const PoseParameters& highest)
      : low(lowest), high(highest) {}

  /// The parameters that lie beyond their bounds.
  [[nodiscard]] ParameterSet beyond(const PoseParameters& parameters) const;
  [[nodiscard]] bool contains(const PoseParameters& parameters) const {
    return beyond(parameters).none();
  }
  /// Whether max_rotation_rad() and max_translation_mm() state the whole range.
  [[nodiscard]] bool is_symmetric() const;
  /// The bound farthest from zero.
  [[nodiscard]] double max_rotation_rad() const;
  [[nodiscard]] double max_translation_mm() const;
  /// The largest box within this one that two numbers can state. Its size is 0 where this box does
  /// not hold zero.
  [[nodiscard]] MotionRange symmetric_part() const;
  [[nodiscard]] MotionRange scaled(double factor) const;
  /// The parameters, each clamped to the middle `share` of its bounds.
  [[nodiscard]] PoseParameters clamped(const PoseParameters& parameters, double share = 1.0) const;
  /// "+-10 degrees, +-30 mm", or the bounds of each axis.
  [[nodiscard]] std::string text() const;
};

/// Why a field cannot be sized for the range; empty when it can.
std::vector<std::string> problems(const MotionRange& range);

/// The pose at a share of each axis' bounds, 0 at the low and 1 at the high one: three rotations,
/// then three translations.
PoseParameters pose_at(const MotionRange& range, const std::array<double, 6>& share);

/// A corner of a range. Its parameter `axis` is high where bit `axis` of `corner` is set, otherwise
/// low; corner < 64.
PoseParameters corner_pose(const MotionRange& range, unsigned corner);

/// Uniform within the range; takes six draws.
PoseParameters random_pose(const MotionRange& range, HashRandom& random);

}  // namespace af
