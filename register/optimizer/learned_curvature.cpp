// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/learned_curvature.h"

#include <cmath>

#include <Eigen/Eigenvalues>

namespace af::registration {
namespace {

/// An update whose divisor is smaller, relative to its vectors, would be mostly rounding.
constexpr double kLeastCosine = 1e-3;

/// Longer steps were refused too often: from far off the gradients say little about the end.
constexpr double kLeastShare = 1.0 / 3.0;
constexpr double kMostShare = 3.0;

}  // namespace

void LearnedCurvature::clear() {
  missing_.setZero();
  is_empty_ = true;
}

void LearnedCurvature::learn(const ScaledParameters& step,
                             const TargetValue& before,
                             const TargetValue& after) {
  const ScaledParameters unexplained =
      before.gradient - after.gradient - (after.matrix + missing_) * step;
  const double along = unexplained.dot(step);
  if (!(std::abs(along) > kLeastCosine * unexplained.norm() * step.norm())) return;
  missing_ += unexplained * unexplained.transpose() / along;
  is_empty_ = false;
}

ScaledMatrix LearnedCurvature::added_to(const ScaledMatrix& matrix) const {
  if (is_empty_) return matrix;
  const Eigen::GeneralizedSelfAdjointEigenSolver<ScaledMatrix> shares(matrix + missing_, matrix);
  if (shares.info() != Eigen::Success) return matrix;
  // The eigenvectors V are scaled so that V' matrix V = 1, hence the sum is
  // (matrix V) diag(shares) (matrix V)'.
  const ScaledMatrix axes = matrix * shares.eigenvectors();
  const ScaledParameters limited = shares.eigenvalues().cwiseMax(kLeastShare).cwiseMin(kMostShare);
  return axes * limited.asDiagonal() * axes.transpose();
}

}  // namespace af::registration
