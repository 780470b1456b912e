// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/pose_information.h"

#include <algorithm>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace af::registration {
namespace {

PoseVector sum_of(const TileScores& scores) {
  PoseVector sum = PoseVector::Zero();
  for (const PoseVector& score : scores) sum += score;
  return sum;
}

/// The views' gradients at a small motion from the origin of `frame`. Empty where that is
/// inadmissible.
std::vector<PoseVector> gradients_beside(MultiViewObjective& objective,
                                         const PoseFrame& frame,
                                         const PoseVector& motion) {
  const PoseParameters parameters{motion.head<3>(), motion.tail<3>()};
  std::vector<TileScores> scores;
  objective.evaluate_scores(pose_from_parameters(frame, parameters),
                            frame.center_room_mm + parameters.translation_mm,
                            1,
                            scores);
  std::vector<PoseVector> gradients;
  gradients.reserve(scores.size());
  for (const TileScores& view : scores) gradients.push_back(sum_of(view));
  return gradients;
}

/// Step (mm) of the projected motion along a direction of the basis.
double step_mm(const PoseVector& direction) {
  const double turn_rad = direction.head<3>().norm();
  const double move_mm = direction.tail<3>().norm();
  return std::min({kInformationStepMm,
                   kLargestInformationTurnRad / turn_rad,
                   kLongestInformationMoveMm / move_mm});
}

}  // namespace

PoseMatrix bent_curvature(const PoseMatrix& curvature,
                          const PoseMatrix& basis,
                          const PoseMatrix& scatter) {
  const Eigen::SelfAdjointEigenSolver<PoseMatrix> solver(basis.transpose() * curvature * basis);
  const double largest = solver.eigenvalues()[5];
  if (!(largest > 0.0)) return PoseMatrix::Zero();
  const PoseMatrix& directions = solver.eigenvectors();
  const PoseMatrix along = basis * directions;
  const PoseVector drowned =
      (along.transpose() * scatter * along).diagonal().cwiseSqrt() / kScatterLengthMm;
  const PoseVector kept = solver.eigenvalues().cwiseMax(
      drowned.cwiseMin(kDrownedCurvature * largest).cwiseMax(kLeastRelativeCurvature * largest));
  const PoseMatrix bent = directions * kept.asDiagonal() * directions.transpose();
  const PoseMatrix back = basis.inverse();
  return back.transpose() * bent * back;
}

std::optional<PoseInformation> information_at(MultiViewObjective& objective,
                                              const PoseFrame& frame,
                                              const PoseMatrix& basis,
                                              int tiles) {
  std::vector<TileScores> here;
  const RigidTransform pose = pose_from_parameters(frame, {});
  if (!objective.evaluate_scores(pose, frame.center_room_mm, tiles, here).is_admissible)
    return std::nullopt;
  PoseInformation information;
  std::vector<PoseVector> center;
  for (const TileScores& view : here) {
    center.push_back(sum_of(view));
    for (const PoseVector& score : view) information.scatter += score * score.transpose();
  }
  information.view_curvatures.assign(here.size(), PoseMatrix::Zero());
  for (int k = 0; k < 6; ++k) {
    const double step = step_mm(basis.col(k));
    const PoseVector motion = step * basis.col(k);
    std::vector<PoseVector> ahead = gradients_beside(objective, frame, motion);
    std::vector<PoseVector> behind = gradients_beside(objective, frame, -motion);
    if (ahead.empty() && behind.empty()) return std::nullopt;
    const double way = (ahead.empty() || behind.empty() ? 1.0 : 2.0) * step;
    if (ahead.empty()) ahead = center;
    if (behind.empty()) behind = center;
    for (std::size_t view = 0; view < center.size(); ++view)
      information.view_curvatures[view].col(k) = (behind[view] - ahead[view]) / way;
  }
  const PoseMatrix back = basis.inverse();
  for (PoseMatrix& view : information.view_curvatures) {
    view *= back;
    view = 0.5 * (view + view.transpose().eval());
    information.curvature += view;
  }
  information.curvature = bent_curvature(information.curvature, basis);
  return information;
}

}  // namespace af::registration
