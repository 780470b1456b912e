// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/curvature_bounds.h"

#include <Eigen/Eigenvalues>

namespace af::registration {

ScaledMatrix kept_between(const ScaledMatrix& curvature,
                          const ScaledMatrix& scale,
                          double least,
                          double most) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<ScaledMatrix> solver(curvature, scale);
  if (solver.info() != Eigen::Success) return scale;
  // The eigenvectors V are scaled so that V' scale V = 1, hence the curvature is
  // (scale V) diag(sizes) (scale V)'.
  const ScaledMatrix directions = scale * solver.eigenvectors();
  return directions * solver.eigenvalues().cwiseMax(least).cwiseMin(most).asDiagonal() *
         directions.transpose();
}

}  // namespace af::registration
