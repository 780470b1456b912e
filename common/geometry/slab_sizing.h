// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "geometry/light_slab.h"
#include "geometry/motion_range.h"

namespace af {

/// Extent of ray hits on one plane y = const (mm).
struct PlaneExtent {
  double x_low_mm = 0.0, x_high_mm = 0.0;  ///< along u or s
  double z_low_mm = 0.0, z_high_mm = 0.0;  ///< along v or t
};

/// The margin that extents_on_planes() adds on all four sides, as a share of the plane's larger
/// side or of 1 mm, whichever is larger.
inline constexpr double kExtentMargin = 1e-6;

/// Where all rays of a camera can meet the planes y = `plane_y_mm` of the slab frame while the CT
/// moves within `range`. Generalises eq. (3), Sec. II-C: true detector corners, any nominal pose,
/// rotations about room axes.
/// For a fixed rotation the hit point is linear in the translation and projective in the detector
/// point, so corners decide both. Over rotations the maximum is searched on a grid and refined.
/// Extents include a safety margin, kExtentMargin. Throws InputError when a ray can become parallel
/// to the planes (range too large). \test SlabSizing.NoInRangeRayMissesAPlane
std::vector<PlaneExtent> extents_on_planes(const CameraGeometry& camera,
                                           const PoseFrame& frame,
                                           const MotionRange& range,
                                           std::span<const double> plane_y_mm);

/// The same in any slab frame, such as that of a field made for another camera or pose.
std::vector<PlaneExtent> extents_on_planes(const CameraGeometry& camera,
                                           const PoseFrame& frame,
                                           const MotionRange& range,
                                           std::span<const double> plane_y_mm,
                                           const RigidTransform& slab_from_ct);

/// Lowest y that the X-ray source can reach in a slab frame while the CT moves within `range`.
double lowest_source_y_mm(const CameraGeometry& camera,
                          const PoseFrame& frame,
                          const MotionRange& range,
                          const RigidTransform& slab_from_ct);

/// Points x with normal . x <= offset_mm.
struct HalfSpace {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  double offset_mm = 0.0;

  [[nodiscard]] bool contains(const Eigen::Vector3d& point) const {
    return normal.dot(point) <= offset_mm;
  }
  /// The same points in another frame.
  [[nodiscard]] HalfSpace in(const RigidTransform& other_from_own) const;
  auto members() { return std::tie(normal, offset_mm); }
};

/// Sizes of a field's planes and resolutions.
struct LightSlabSpec {
  int uv_nodes = 64;
  int st_nodes = 256;
  std::vector<double> slab_boundaries_y_mm;  ///< K - 1 inner boundaries, ascending; empty for K = 1
  std::vector<double> st_plane_y_mm = {0.0};  ///< one per slab, in the order of ascending y
  /// The field holds only those of the range's poses whose source lies in all of these (ct frame);
  /// none means all poses. For further cameras it holds all poses. If these leave less than the
  /// whole (u,v) plane, its shorter side gets fewer nodes, no farther apart than along the other.
  std::vector<HalfSpace> sources;
};

/// The complete geometry of a field. Every slab is cropped to the shadow that
/// `attenuating_corners_ct` (corners of convex bodies that hold all attenuation, ct frame) can
/// throw from the (u,v) rectangle, plus one node, even-aligned. The planes also hold the rays of
/// `more_cameras` over the same range. Throws InputError when a source can enter the CT's depth
/// range, or when the range is too large.
LightSlab make_light_slab(const CameraGeometry& camera,
                          const PoseFrame& frame,
                          const MotionRange& range,
                          const std::array<Eigen::Vector3d, 8>& attenuating_corners_ct,
                          const LightSlabSpec& spec,
                          std::span<const CameraGeometry> more_cameras = {});

}  // namespace af
