// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/curvature_bounds.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace af::registration {

ScaledMatrix kept_between(const ScaledMatrix& curvature,
                          const ScaledMatrix& scale,
                          double least,
                          double most) {
  // The solver does not check that the scale is positive definite.
  if (scale.llt().info() != Eigen::Success) return scale;
  const Eigen::GeneralizedSelfAdjointEigenSolver<ScaledMatrix> solver(curvature, scale);
  if (solver.info() != Eigen::Success) return scale;
  // The eigenvectors V are scaled so that V' scale V = 1. The curvature is therefore (scale V)
  // diag(sizes) (scale V)'.
  const ScaledMatrix directions = scale * solver.eigenvectors();
  return directions * solver.eigenvalues().cwiseMax(least).cwiseMin(most).asDiagonal() *
         directions.transpose();
}

}  // namespace af::registration
