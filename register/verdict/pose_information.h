// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "geometry/rigid_transform.h"
#include "register/problem/multi_view_objective.h"
#include "register/problem/pose_target.h"

namespace af::registration {

/// What the objective of a registration says about a pose that maximises it. Matrices refer to
/// small motions (rx, ry, rz, tx, ty, tz) of the CT in the room about the frame's centre, per rad
/// and mm.
struct PoseInformation {
  PoseMatrix curvature = PoseMatrix::Zero();  ///< negative Hessian, made positive definite
  /// Sum over tiles of score score', where score is the tile's share of the gradient. It is the
  /// gradient's variance if what the DRRs do not explain is independent from tile to tile.
  PoseMatrix scatter = PoseMatrix::Zero();
  std::vector<PoseMatrix> view_curvatures;  ///< their sum is `curvature` before it was bent
};

/// The information at the origin of `frame`. Curvature comes from central differences of the
/// gradient over kInformationStepMm of projected motion (along `basis`, from
/// projected_motion_basis()) to both sides. The step is shorter where that would be far, and
/// one-sided where the other side is inadmissible. Takes 13 evaluations. nullopt where neither side
/// is admissible. The measures must have derivatives.
/// Along the room's axes instead, depth with one view would be the difference of motions that
/// X-rays show a thousand times better. \test PoseInformation.OfAQuadraticObjectiveIsItsHessian
std::optional<PoseInformation> information_at(MultiViewObjective& objective,
                                              const PoseFrame& frame,
                                              const PoseMatrix& basis,
                                              int tiles);

/// Long enough to average over a field's nodes, and short compared with the way over which
/// curvatures change.
inline constexpr double kInformationStepMm = 0.2;

/// Limits motions that hardly move projections, as depth with one view of a small object.
inline constexpr double kLongestInformationMoveMm = 8.0;
inline constexpr double kLargestInformationTurnRad = 0.05;

/// Curvatures below this share of the largest, per squared projected motion, are raised to it,
/// because differences cannot tell them from zero or from an upward bend.
inline constexpr double kLeastRelativeCurvature = 1e-2;

/// What DRRs do not explain changes the gradient by its scatter over about this much projected
/// motion, in which a smaller curvature drowns. Right poses of clean X-rays bend by
/// kDrownedCurvature of the largest or more in all directions, so nothing is raised above that.
inline constexpr double kScatterLengthMm = 1.0;
inline constexpr double kDrownedCurvature = 0.05;

/// The matrix with its eigenvalues in `basis` no less than kLeastRelativeCurvature of the largest,
/// and no less than what drowns in `scatter`. Zero where the largest is not positive.
/// \test BentCurvature.KeepsDirectionsThatAreKnown \test BentCurvature.RaisesWhatDrownsInScatter
PoseMatrix bent_curvature(const PoseMatrix& curvature,
                          const PoseMatrix& basis,
                          const PoseMatrix& scatter = PoseMatrix::Zero());

}  // namespace af::registration
