// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ct/ct_volume.h"
#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af {

/// An implanted steel pin, ct frame (mm).
struct SteelCylinder {
  Eigen::Vector3d center_point = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis_direction = Eigen::Vector3d::UnitZ();  ///< unit
  double radius_mm = 1.0;
  double length_mm = 6.0;

  /// Length (mm) of the half-line from `source_point` through `through_point` inside the cylinder,
  /// in closed form. \test SteelCylinder.ChordsHaveTheirClosedForms
  [[nodiscard]] double chord_length_mm(const Eigen::Vector3d& source_point,
                                       const Eigen::Vector3d& through_point) const;
};

/// Four pins about 25 mm from each other around `center_ct_mm`, not coplanar. They are the corners
/// of a regular tetrahedron with that edge. Each is moved to the nearest bone (>= 250 HU) that lies
/// within 10 mm and keeps the pins at least 15 mm apart. A corner without such bone stays where it
/// is.
std::vector<SteelCylinder> place_fiducials(const CtVolume& ct, const Eigen::Vector3d& center_ct_mm);

/// Detected positions (column, row) of the pins' centres in an X-ray: their projections, with
/// independent normal errors of `sigma_px` in both coordinates, keyed by (seed, key, pin).
std::vector<Eigen::Vector2d> detect_fiducials(const CameraGeometry& camera,
                                              const RigidTransform& room_from_ct,
                                              std::span<const SteelCylinder> fiducials,
                                              double sigma_px,
                                              std::uint64_t seed,
                                              std::uint64_t key);

}  // namespace af
