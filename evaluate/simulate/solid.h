// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "ct/ct_volume.h"
#include "geometry/ct_box.h"
#include "geometry/rigid_transform.h"

namespace af {

/// A body of constant HU with an optional texture, in the ct frame (mm). Where bodies overlap,
/// later ones replace earlier ones.
struct Solid {
  enum class Shape {
    Ellipsoid,
    HalfEllipsoid,     ///< the half of an ellipsoid at positive z of the body
    EllipticCylinder,  ///< axis along the body's z; narrower by `waist` at half height
    Capsule,           ///< a segment along z of half length half_sizes_mm.z(), fattened by
                       ///< half_sizes_mm.x()
  };
  Shape shape = Shape::Ellipsoid;
  Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_sizes_mm = Eigen::Vector3d::Ones();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< columns: the body's axes in ct
  double waist = 0.0;  ///< share of the radius lost at half height, in [0, 1)
  int hu = 0;
  int texture_hu = 0;  ///< amplitude of the texture added to hu
  double texture_scale_mm = 3.0;
  Eigen::Vector3d texture_shift_mm =
      Eigen::Vector3d::Zero();  ///< gives other values at the same point
  Eigen::Matrix3d texture_rotation = Eigen::Matrix3d::Identity();  ///< applied to shifted points
  std::string_view bone = {};  ///< PhantomBone with which it moves; empty: stays with the rest

  [[nodiscard]] bool contains(const Eigen::Vector3d& ct_point_mm) const;
  /// HU at a point of the body, with its texture.
  [[nodiscard]] int hu_at(const Eigen::Vector3d& ct_point_mm) const;
  /// Half the sides of the box around its centre, along the body's axes, that holds it.
  [[nodiscard]] Eigen::Vector3d reach_mm() const;
  /// A box along the ct axes that holds the body.
  [[nodiscard]] CtBox bounds() const;
};

/// The body after a motion of the ct frame, with its texture.
Solid moved(Solid solid, const RigidTransform& motion);

/// std::lround() without a call or a branch, because X-rays and voxels round millions of HU.
inline int nearest_hu(double hu) {
  const int whole = static_cast<int>(hu);
  return whole + static_cast<int>(2.0 * (hu - whole));
}

/// The capsule of radius `radius_mm` around the segment from a to b.
Solid capsule_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius_mm, int hu);

/// Smooth deterministic noise in [-1, 1], correlated over `scale_mm`: trilinear blends of hashed
/// lattice values. For points within 1e15 scales of the origin.
/// \test Texture.BlendsTheLatticeWhateverCameBefore
double texture(const Eigen::Vector3d& ct_point_mm, double scale_mm);

/// Bodies sampled on a grid with identity direction. Every voxel is the mean HU of
/// samples_per_axis^3 points; elsewhere it is air (-1000 HU). The result does not depend on
/// `threads` (0: as many as the hardware has).
CtVolume sample_solids(const CtGrid& grid,
                       const std::vector<Solid>& solids,
                       int samples_per_axis,
                       int threads);

}  // namespace af
