// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "geometry/camera_geometry.h"
#include "geometry/field_lattice.h"
#include "geometry/rigid_transform.h"

namespace af {

/// Equidistant nodes along one axis of a plane, the first and the last on the plane's edges (mm).
struct GridAxis {
  double first_mm = 0.0;
  double last_mm = 0.0;
  int nodes = 2;

  [[nodiscard]] double length_mm() const { return last_mm - first_mm; }
  [[nodiscard]] double spacing_mm() const { return length_mm() / (nodes - 1); }
  [[nodiscard]] double position_mm(int node) const { return first_mm + spacing_mm() * node; }
  /// Position in continuous node units: 0 on the first edge, nodes - 1 on the last.
  [[nodiscard]] double node_coordinate(double position_mm) const {
    return (position_mm - first_mm) / spacing_mm();
  }
  [[nodiscard]] bool contains(double position_mm) const {
    return position_mm >= first_mm && position_mm <= last_mm;
  }
};

/// One slab of the CT between two planes y = const of the slab frame, seen through its own (s,t)
/// plane.
struct SlabGeometry {
  double st_plane_y_mm = 0.0;
  double y_low_mm = -std::numeric_limits<double>::infinity();  ///< attenuation with y in [y_low,
                                                               ///< y_high) belongs here
  double y_high_mm = std::numeric_limits<double>::infinity();
  GridAxis s;  ///< along x of the slab frame; the uncropped rectangle
  GridAxis t;  ///< along z
  NodeRange stored_s;
  NodeRange stored_t;
};

/// Continuous node coordinates of a ray on the (u,v) plane and one slab's (s,t) plane.
struct RayNodes {
  double u = 0.0, v = 0.0, s = 0.0, t = 0.0;
};

/// Two-plane parameterisation of all rays of a field (Russakoff 2005, Fig. 6), generalised to any
/// camera and to depth slabs. Slab frame: x along the detector's columns, y from detector to source
/// (perpendicular to the detector), z = x cross y, origin at the field's centre c; the (u,v) plane
/// is y = uv_plane_y_mm and holds the nominal source. u and s run along x, v and t along z. The
/// frame is fixed to the CT; a registration moves both relative to the camera.
struct LightSlab {
  RigidTransform slab_from_ct = RigidTransform::Identity();
  double uv_plane_y_mm = 0.0;  ///< f of the paper when K = 1
  GridAxis u;
  GridAxis v;
  std::vector<SlabGeometry> slabs;  ///< K of them; 1 is the paper's field
  /// Upper bound of the y of all attenuation; infinite where it is unknown.
  double attenuation_end_y_mm = std::numeric_limits<double>::infinity();

  [[nodiscard]] Eigen::Vector3d viewpoint(int u_node, int v_node) const {
    return {u.position_mm(u_node), uv_plane_y_mm, v.position_mm(v_node)};
  }
  [[nodiscard]] Eigen::Vector3d st_point(const SlabGeometry& slab, int s_node, int t_node) const {
    return {slab.s.position_mm(s_node), slab.st_plane_y_mm, slab.t.position_mm(t_node)};
  }
  /// Whether a slab and all attenuation lie in front of a source at `y_mm`. A field holds whole
  /// lines, but rays begin at the source.
  [[nodiscard]] bool lies_before(double y_mm, const SlabGeometry& slab) const {
    return y_mm > slab.st_plane_y_mm &&
           (y_mm > attenuation_end_y_mm || std::isinf(attenuation_end_y_mm));
  }
  /// Where a ray (slab frame) meets both planes; nullopt when it misses a rectangle, does not
  /// descend in y, or has attenuation behind or around its origin.
  [[nodiscard]] std::optional<RayNodes> intersect(const Ray& ray_in_slab,
                                                  const SlabGeometry& slab) const;
  /// Derivative of a value as its ray's origin and direction change. `slopes` are the value's
  /// derivatives with respect to the node coordinates (u, v, s, t).
  [[nodiscard]] double slope_along(const std::array<double, 4>& slopes,
                                   const Ray& ray_in_slab,
                                   const Ray& change,
                                   const SlabGeometry& slab) const;

  /// The nodes as integers: all of u and v, and the part of s and t that slab `k` stores.
  [[nodiscard]] SlabLattice lattice(std::size_t k) const {
    return {{u.nodes, {0, u.nodes}},
            {v.nodes, {0, v.nodes}},
            {slabs[k].s.nodes, slabs[k].stored_s},
            {slabs[k].t.nodes, slabs[k].stored_t}};
  }
  [[nodiscard]] FieldLattice lattice() const;
};

/// Why it cannot be a field's geometry; empty when it can.
std::vector<std::string> problems(const LightSlab& light_slab);

/// Slab frame of a camera at the nominal pose of `frame`: slab_from_ct.
RigidTransform slab_from_ct_at_nominal(const CameraGeometry& camera, const PoseFrame& frame);

}  // namespace af
