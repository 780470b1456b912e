// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "evaluate/scan/scan_geometry.h"
#include "xray/image2d.h"

namespace af {

/// The parameters of a view's camera that alignment corrects: column and row of the beam's foot
/// (px) and the detector's rotation in its plane (rad).
inline constexpr int kViewParameters = 3;
using ViewVector = Eigen::Matrix<double, kViewParameters, 1>;
using ViewMatrix = Eigen::Matrix<double, kViewParameters, kViewParameters>;

/// How a measured image differs from a predicted one. This is a step of robust least squares for
/// measured = gain * predicted(moved), with the gain eliminated.
struct ViewAlignment {
  ViewMatrix normal =
      ViewMatrix::Zero();                 ///< of the parameters, including weights and 1 / variance
  ViewVector right = ViewVector::Zero();  ///< normal * step = right
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  ///< column and row alone, without rotation
  double rotation_rad = 0.0;                           ///< from all three together
  /// The share of a shift that noise of the prediction lets through, for column and row: the slope
  /// of measured on predicted gradients. Shifts are divided by it.
  Eigen::Vector2d response = Eigen::Vector2d::Ones();
  double cost = 0.0;  ///< mean of the robust residual, in units of the measured image's variance
  double gain = 1.0;
  /// measured - gain * predicted, divided by what is expected there: its robust standard deviation,
  /// and a share of the predicted detail around it, which no reconstruction predicts exactly.
  std::vector<float> residual;
};

/// Both images are band passed. `weight` says which pixels count (not 0). The rotation is about
/// `beam_foot_px`. \test ViewAlignment.FindsAKnownMotion
ViewAlignment align_view(const Image2d& measured,
                         const Image2d& predicted,
                         const std::vector<unsigned char>& is_counted,
                         const Eigen::Vector2d& beam_foot_px,
                         const Eigen::Vector2d& pixel_spacing_mm);

}  // namespace af
