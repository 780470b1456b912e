// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/rigid_transform.h"
#include "register/verdict/pose_information.h"

namespace af::registration {

/// Covariance of the maximiser of an objective whose gradient at the truth has the information's
/// scatter: C^-1 J C^-1, for (rx, ry, rz, tx, ty, tz), rad and mm. This is the sandwich of Huber
/// 1967 and White, Econometrica 48(4), 1980, with tiles as the clusters of Liang and Zeger,
/// Biometrika 73(1), 1986. nullopt when the curvature is not positive definite.
/// \test PoseCovariance.PredictsTheSpreadOfRepeatedFits
std::optional<PoseMatrix> sandwich_covariance(const PoseInformation& information);

/// The covariance from errors that shift the views' images. These are independent normal errors of
/// `shifts_mm[view]` (standard deviations along columns and rows, mm at the isocentre). A shift
/// moves a view's optimum as a translation of the CT along the detector would, and the views'
/// curvatures weight the views: C^-1 (sum_v C_v T_v T_v' C_v) C^-1.
/// \test PoseCovariance.OfAShiftedViewIsTheTranslationThatMendsIt
PoseMatrix shift_covariance(const PoseInformation& information,
                            std::span<const View> views,
                            std::span<const Eigen::Vector2d> shifts_mm);

/// TRE that a covariance predicts.
struct PredictedTre {
  /// Root of the expected squared distance, averaged over the points. NaN for a covariance that is
  /// not finite.
  double rms_mm = std::numeric_limits<double>::quiet_NaN();
  /// 95 % quantile of the root mean squared distance, which the mean distance does not exceed. The
  /// quadratic form is taken as a scaled chi-square with its mean and variance (Satterthwaite
  /// 1946), by Wilson and Hilferty's cube root (1931).
  double upper_95_mm = std::numeric_limits<double>::quiet_NaN();
};

/// \test PredictedTre.IsThatOfDrawnPoses
PredictedTre predicted_tre(const PoseMatrix& covariance,
                           const PoseFrame& frame,
                           std::span<const Eigen::Vector3d> target_points_ct);

/// 95 % half-width of a point's place along the beam that meets it (mm). NaN for a covariance that
/// is not finite. \test DepthAlongTheBeam.IsThatOfDrawnPoses
double depth_95_mm(const PoseMatrix& covariance,
                   const PoseFrame& frame,
                   const Eigen::Vector3d& point_ct_mm,
                   const Eigen::Vector3d& source_room_mm);

/// Upper triangle, row by row, in deg and mm.
std::array<double, 21> in_deg_mm(const PoseMatrix& covariance);
/// The inverse of in_deg_mm(): the matrix in rad and mm.
PoseMatrix from_deg_mm(const std::array<double, 21>& upper_triangle);

/// Squared Mahalanobis distance of an error (rad and mm). Inside the 95 % region it is below
/// kPoseRegion95.
double squared_distance(const PoseMatrix& covariance, const PoseVector& error);

/// 95 % quantile of chi-square with six degrees of freedom.
inline constexpr double kPoseRegion95 = 12.591587243743977;

}  // namespace af::registration
