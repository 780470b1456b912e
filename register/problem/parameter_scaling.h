// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/rigid_transform.h"
#include "geometry/slab_sizing.h"
#include "register/optimizer/optimizer.h"
#include "volume/ct_volume.h"

namespace af::registration {

/// How far one unit of each pose parameter moves the CT's projection, so that steps of all
/// parameters compare.
struct ParameterScaling {
  /// Mean displacement, in mm on the isocentre plane, per rad (rx, ry, rz) and per mm (tx, ty, tz).
  ScaledParameters displacement_mm = ScaledParameters::Ones();

  [[nodiscard]] PoseParameters unscaled(const ScaledParameters& point) const;
};

/// Points (ct frame, mm) that stand for the CT's voxels when steps are scaled: the centres of
/// `points_per_axis`^3 equal cells of the volume.
std::vector<Eigen::Vector3d> ct_lattice_points(const CtGrid& grid, int points_per_axis = 24);
/// The same for a box in the ct frame.
std::vector<Eigen::Vector3d> ct_lattice_points(const CtBox& box, int points_per_axis = 24);

/// Mean displacement (to first order, for rotations about the room's axes through `center_ct_mm`)
/// of those `points_ct` that project into the region of interest of at least one view, on the plane
/// through `isocenter_point` parallel to each view's detector, averaged over points and views, at
/// `room_from_ct` (Sec. III-B2; what the paper leaves open is settled in the project's guide).
/// nullopt when no point projects into a region.
std::optional<ParameterScaling> projected_motion_scaling(const RigidTransform& room_from_ct,
                                                         const Eigen::Vector3d& center_ct_mm,
                                                         std::span<const Eigen::Vector3d> points_ct,
                                                         std::span<const View> views,
                                                         const Eigen::Vector3d& isocenter_point);

}  // namespace af::registration
