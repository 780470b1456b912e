// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <tuple>

namespace af::registration {

/// What the target says of an end by itself, with everything else of the CT held there
/// (TargetExaminer). NaN where it was not asked.
struct TargetEvidence {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  /// Of what the pose explains of the X-rays' gradients about the target's shadow: the part that is
  /// lost without the target. 0: the rest explains as much.
  double share = kNone;
  /// How far from the pose the target alone fits best: the mean displacement of its points across
  /// the beam, mm at the isocentre, in the view that shows it most.
  double apart_mm = kNone;

  auto members() { return std::tie(share, apart_mm); }
};

/// Targets of rigid patients fit within 0.6 mm, bones that moved by 2 to 6 mm at least 1.1 mm away.
inline constexpr double kTargetApartMm = 0.75;

/// A target with less than this share shows next to nothing of its own.
inline constexpr double kLeastTargetShare = 0.05;

}  // namespace af::registration
