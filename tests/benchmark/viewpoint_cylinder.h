// SPDX-License-Identifier: Apache-2.0
// The rays of a C-arm's orbit seen from viewpoints on a cylinder. Each column of viewpoints has its
// own (s,t) planes. Atlases of planes are compared with this (docs/other-cameras.md).
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "geometry/orbit.h"
#include "precompute/casting/depth_slabs.h"

namespace af::benchmark {

/// The depth slabs of a CT in a frame (slab_from_ct).
using DepthSlabsOf = std::function<DepthSlabs(const RigidTransform&)>;

/// A rig's camera, the CT before it, and the range of poses and the orbit that are to be held.
struct OrbitScene {
  CameraGeometry camera;
  Eigen::Vector3d isocenter_point = Eigen::Vector3d::Zero();
  PoseFrame frame;
  MotionRange range;
  Orbit orbit;  ///< about z
  std::array<Eigen::Vector3d, 8> attenuating_corners_ct;
  DepthSlabsOf depth_slabs;
};

/// A ray among the columns: its value is the mean of two columns' values with these weights.
struct ColumnsOfRay {
  int lower = 0;        ///< this column and the next
  double weight = 0.0;  ///< of the next
};

/// Viewpoints at equal angles on a cylinder about the room's z through the isocentre, fixed to the
/// CT as a field's planes are. A ray is found between two columns by where it meets the cylinder on
/// its way in. In each column two points place it: where it meets the plane that touches the
/// cylinder there (along the axis), and where it meets the column's own (s,t) planes, which face
/// the column.
/// \test ViewpointCylinder.HoldsEveryRayOfTheOrbit
class ViewpointCylinder {
 public:
  /// Sized to hold every ray of the range at every angle of the orbit. Columns are at most
  /// `step_rad` apart, from the least angle at which a ray meets the cylinder to the largest. Each
  /// holds the v, s and t of all rays within a step of it. Throws InputError when sources move too
  /// far aside.
  ViewpointCylinder(const OrbitScene& scene, double step_rad);

  /// The planes of each column; y = uv_plane_y_mm touches the cylinder. Nothing is stored along u.
  [[nodiscard]] const std::vector<LightSlab>& columns() const { return columns_; }
  /// The angle by which the nominal camera is turned to stand at a column.
  [[nodiscard]] double angle_rad(int column) const { return first_rad_ + column * step_rad_; }
  /// Viewpoints of a column (its slab frame) lie along z, at this x.
  [[nodiscard]] double viewpoint_x_mm(int column) const {
    return viewpoint_x_mm_[static_cast<std::size_t>(column)];
  }
  /// Where a ray (ct frame) lies among the columns. Empty when it is beyond the outermost, or
  /// passes the axis outside the cylinder.
  [[nodiscard]] std::optional<ColumnsOfRay> columns_of(const Ray& ray_ct) const;

 private:
  RigidTransform axis_from_ct_;  ///< z along the axis, x towards the nominal source
  double radius_mm_ = 0.0;
  double first_rad_ = 0.0;
  double step_rad_ = 0.0;
  std::vector<LightSlab> columns_;
  std::vector<double> viewpoint_x_mm_;
};

/// Planes of a member of an orbit. Nodes are so dense along (s,t) that the stored ones end at the
/// edge of the CT's shadow.
LightSlab planes_of(const OrbitScene& scene, const OrbitMember& member);

}  // namespace af::benchmark
