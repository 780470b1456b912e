// SPDX-License-Identifier: Apache-2.0
#include "register/uncertainty/pose_information.h"

#include <Eigen/Eigenvalues>

namespace af::registration {
namespace {

PoseVector sum_of(const TileScores& scores) {
  PoseVector sum = PoseVector::Zero();
  for (const PoseVector& score : scores) sum += score;
  return sum;
}

/// The views' gradients beside the origin of `frame`, at `step` of parameter `k`; empty where that
/// is inadmissible.
std::vector<PoseVector> gradients_beside(MultiViewObjective& objective,
                                         const PoseFrame& frame,
                                         int k,
                                         double step) {
  PoseParameters parameters;
  (k < 3 ? parameters.rotation_rad[k] : parameters.translation_mm[k - 3]) = step;
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

}  // namespace

PoseMatrix bent_curvature(const PoseMatrix& curvature, const ParameterScaling& scaling) {
  const PoseVector& scale = scaling.displacement_mm;
  const PoseMatrix scaled =
      scale.cwiseInverse().asDiagonal() * curvature * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<PoseMatrix> solver(scaled);
  const double largest = solver.eigenvalues()[5];
  if (!(largest > 0.0)) return PoseMatrix::Zero();
  const PoseVector kept = solver.eigenvalues().cwiseMax(kLeastRelativeCurvature * largest);
  const PoseMatrix bent =
      solver.eigenvectors() * kept.asDiagonal() * solver.eigenvectors().transpose();
  return scale.asDiagonal() * bent * scale.asDiagonal();
}

std::optional<PoseInformation> information_at(MultiViewObjective& objective,
                                              const PoseFrame& frame,
                                              const ParameterScaling& scaling,
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
    const double step = kInformationStepMm / scaling.displacement_mm[k];
    std::vector<PoseVector> ahead = gradients_beside(objective, frame, k, step);
    std::vector<PoseVector> behind = gradients_beside(objective, frame, k, -step);
    if (ahead.empty() && behind.empty()) return std::nullopt;
    const double way = ahead.empty() || behind.empty() ? step : 2.0 * step;
    if (ahead.empty()) ahead = center;
    if (behind.empty()) behind = center;
    for (std::size_t view = 0; view < center.size(); ++view)
      information.view_curvatures[view].col(k) = (behind[view] - ahead[view]) / way;
  }
  for (PoseMatrix& view : information.view_curvatures) {
    view = 0.5 * (view + view.transpose().eval());
    information.curvature += view;
  }
  information.curvature = bent_curvature(information.curvature, scaling);
  return information;
}

}  // namespace af::registration
