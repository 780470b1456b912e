// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <tuple>

namespace af::registration {

/// What the target alone says about an end, with everything else of the CT held there
/// (TargetExaminer). NaN where it was not asked, or has no answer.
struct TargetEvidence {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  /// The part of what the pose explains of the X-rays' gradients around the target's shadow that is
  /// lost without the target. 0: the rest explains as much.
  double share = kNone;
  /// How far from the pose the target alone fits best: the mean displacement of its points across
  /// the beam, mm at the isocentre, in the view that shows it most.
  double apart_mm = kNone;
  /// Whether it was asked and could not answer (TargetExaminer::evidence()).
  bool has_no_answer = false;

  auto members() { return std::tie(share, apart_mm, has_no_answer); }
};

/// A target that fits farther than this from an end has moved relative to its surroundings. The two
/// values are the least distance, and what is added to it where a pose leaves all of the X-rays'
/// gradients unexplained, which hides where the target is. `jobs/verdicts.py`, docs/uncertainty.md.
inline constexpr double kTargetApartMm = 0.2;
inline constexpr double kTargetApartUnexplainedMm = 0.9;
inline constexpr double kMostTargetApartMm = 0.75;

/// A target with less than this share shows almost nothing of its own.
inline constexpr double kLeastTargetShare = 0.05;

/// How much more often the target of a right end agrees with its surroundings than that of a wrong
/// one, including moved bones. 3 to 8 were measured.
inline constexpr double kAgreementOdds = 2.0;

}  // namespace af::registration
