// SPDX-License-Identifier: Apache-2.0
// Regions of interest that follow the target box.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "drr/drr_renderer.h"
#include "geometry/ct_box.h"
#include "geometry/rigid_transform.h"
#include "register/problem/registration_problem.h"
#include "xray/image2d.h"

namespace af::registration {

/// The rectangle on a detector around the projections of a box's corners, (column, row).
struct ProjectedBox {
  Eigen::Vector2d low_px;
  Eigen::Vector2d high_px;
};

/// None when a corner lies less than 1 mm in front of the source.
std::optional<ProjectedBox> projected_box(const CtBox& box_ct,
                                          const RigidTransform& room_from_ct,
                                          const CameraGeometry& camera);

/// RegistrationView::target_region where the target box is seen at the nominal pose as `box`. It is
/// the region that the study states, extended to hold the box. Without one (`stated`: none), it is
/// the box grown by a quarter of its sides to every side. When nobody stated the nominal pose, the
/// place of the stated region relative to the box means nothing, so it is centred on the box.
/// \test TargetRegion.HoldsTheBoxAndKeepsTheMarginsOfTheStatedRegion
RegionOfInterest target_region_about(const ProjectedBox& box,
                                     const std::optional<RegionOfInterest>& stated,
                                     bool is_nominal_stated);

/// Where a view looks at a pose: its target_region, moved as the middle of the box's projection has
/// moved since the nominal pose, by multiples of `step_px` along columns and rows. It is view.roi
/// when there is no target_region. It may reach beyond the detector: View::scaled() cuts it. Only
/// the place follows. A box that turns by 10 degrees is seen up to a sixth wider, which the margins
/// hold, and a region that keeps its size compares the same number of pixels everywhere. Its middle
/// stays on the detector. It stays where it is at the nominal pose when a corner of the box lies
/// behind the source. \test TargetRegion.FollowsTheBoxInEveryView
RegionOfInterest region_at(const RegistrationProblem& problem,
                           const RegistrationView& view,
                           const RigidTransform& room_from_ct,
                           int step_px = 1);

/// All views with their regions at a pose, cut at the detectors' edges.
std::vector<View> views_at(const RegistrationProblem& problem, const RigidTransform& room_from_ct);

/// How far points of the CT are displaced between two poses, mean over them, across the beam of the
/// view that shows it most: mm on the isocentre plane.
double across_beam_mm(const RegistrationProblem& problem,
                      const std::vector<Eigen::Vector3d>& points_ct,
                      const RigidTransform& from_room_from_ct,
                      const RigidTransform& to_room_from_ct);

}  // namespace af::registration
