// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/sample_summary.h"
#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af {

/// A fiducial's position from two or more views.
struct BackProjection {
  Eigen::Vector3d room_point = Eigen::Vector3d::Zero();  ///< mm
  /// Twice the RMS distance of the point from its rays. For two views this is the length of the
  /// shortest segment between the rays, which the paper reports (Sec. III-B).
  double ray_gap_mm = 0.0;
};

/// The point with the least sum of squared distances to the rays. For two rays this is the midpoint
/// of the shortest segment between them. Throws InputError for fewer than two rays, for rays that
/// are parallel within 1 degree, and when the point lies behind a source.
/// \test BackProjection.OfSkewRaysIsTheMidpointOfTheShortestSegment
BackProjection back_project(std::span<const Ray> rays);

/// Least-squares rigid map between corresponding points.
struct RigidFit {
  RigidTransform target_from_source = RigidTransform::Identity();
  std::vector<double> residuals_mm;  ///< per point, after the fit
  double fre_mm = 0.0;               ///< fiducial registration error: RMS of the residuals
};

/// Arun, Huang, Blostein 1987 / Schoenemann 1966, with Umeyama's guard: the result is never a
/// reflection. Throws InputError for fewer than three points, unequal counts, values that are not
/// finite, and collinear points. \test RigidFit.NeverReturnsAReflection
RigidFit fit_rigid(std::span<const Eigen::Vector3d> target_points,
                   std::span<const Eigen::Vector3d> source_points);

/// Stands for a fiducial that a view does not show.
inline Eigen::Vector2d hidden_fiducial_px() {
  return Eigen::Vector2d::Constant(kNan);
}

/// Whether a view shows a fiducial.
inline bool is_seen(const Eigen::Vector2d& fiducial_px) {
  return fiducial_px.allFinite();
}

/// Where one camera saw the fiducials: (column, row), in the order of the CT's fiducials. Those
/// that it does not show have hidden_fiducial_px().
struct FiducialView {
  CameraGeometry camera;
  std::vector<Eigen::Vector2d> fiducials_px;
};

/// Fewer do not fix a pose.
inline constexpr std::size_t kFewestFiducials = 3;

/// Indices of the fiducials that two or more views show, which fixes their place in the room.
/// Throws InputError when a view has another number of entries.
std::vector<std::size_t> fiducials_in_two_views(std::span<const FiducialView> views,
                                                std::size_t fiducial_count);

/// The gold standard of one case.
struct FiducialGold {
  RigidTransform room_from_ct = RigidTransform::Identity();
  /// The fiducials that two or more views show. Only these take part, and what follows has one
  /// entry for each.
  std::vector<std::size_t> used;
  std::vector<BackProjection> back_projections;
  RigidFit fit;
  /// Distance (mm) of each fiducial from where the pose fitted to all others puts it. Empty when
  /// any fiducial leaves fewer than three others, or others on one line.
  std::vector<double> leave_one_out_mm;
};

/// Leave-one-out distances, as in FiducialGold. \test LeaveOneOut.OfHandComputedCases
std::vector<double> leave_one_out_errors_mm(std::span<const Eigen::Vector3d> target_points,
                                            std::span<const Eigen::Vector3d> source_points);

/// Back-projects every fiducial that two or more views show, and fits the CT's fiducials to the
/// result. Throws InputError as these two steps do (so when fewer than three have a place), and
/// when a view has another number of entries. \test FiducialGold.IsMadeFromThoseThatTwoViewsShow
FiducialGold gold_from_fiducials(std::span<const FiducialView> views,
                                 std::span<const Eigen::Vector3d> fiducials_ct_mm);

}  // namespace af
