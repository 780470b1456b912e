// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ct/ct_volume.h"
#include "drr/drr_renderer.h"
#include "geometry/ct_box.h"

namespace af {

/// Voxels of at least this are bone.
inline constexpr int kBoneHu = 250;

/// Side of the box over which TRE is taken, unless one is stated.
inline constexpr double kTargetSideMm = 60.0;

/// What a registration of a CT must align: the ROI centre, and the box over which TRE is taken.
struct RegistrationTarget {
  Eigen::Vector3d center_ct_mm = Eigen::Vector3d::Zero();
  CtBox box_ct;
};

/// A box of `side_mm` centred on `center_ct_mm`.
RegistrationTarget target_box_at(const Eigen::Vector3d& center_ct_mm, double side_mm);

/// The bone-rich place near the centre of the patient. Candidates are boxes of kTargetSideMm on a 5
/// mm lattice, 15 mm within the CT. The box with the most bone (from kBoneHu on) wins, weighted by
/// exp(-d^2 / (2 s^2)), where d is its distance from the centroid of attenuation and s = 40 mm. It
/// is then centred once on the bone inside it. On a trunk this is a vertebra, on a head the skull
/// base. A CT without bone gets the box at the centroid. \test
/// AutomaticTarget.FindsTheMiddleVertebraOfTheSpinePhantom
RegistrationTarget find_target(const CtVolume& ct);

/// The region of a view for a target at a pose. It is as large as `wanted_px` or the projected box
/// with a margin of 8 px, whichever is larger. It is centred on the projected box centre, and cut
/// to stay 2 px inside the detector. Throws InputError when less than 16 px remain.
RegionOfInterest target_region(const CameraGeometry& camera,
                               const RigidTransform& room_from_ct,
                               const RegistrationTarget& target,
                               const Eigen::Vector2i& wanted_px);

/// The default of `wanted_px`: 200 px, but at most 60 % of the detector's side.
Eigen::Vector2i default_region_size_px(const CameraGeometry& camera);

}  // namespace af
