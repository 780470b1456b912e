// SPDX-License-Identifier: Apache-2.0
#include "geometry/light_slab.h"

namespace af {

std::optional<RayNodes> LightSlab::intersect(const Ray& ray_in_slab,
                                             const SlabGeometry& slab) const {
  const Eigen::Vector3d& origin = ray_in_slab.origin_point;
  const Eigen::Vector3d& direction = ray_in_slab.direction;
  if (!(direction.y() < 0.0)) return std::nullopt;
  const Eigen::Vector3d at_uv = origin + (uv_plane_y_mm - origin.y()) / direction.y() * direction;
  const Eigen::Vector3d at_st =
      origin + (slab.st_plane_y_mm - origin.y()) / direction.y() * direction;
  if (!u.contains(at_uv.x()) || !v.contains(at_uv.z()) || !slab.s.contains(at_st.x()) ||
      !slab.t.contains(at_st.z()))
    return std::nullopt;
  return RayNodes{u.node_coordinate(at_uv.x()),
                  v.node_coordinate(at_uv.z()),
                  slab.s.node_coordinate(at_st.x()),
                  slab.t.node_coordinate(at_st.z())};
}

RigidTransform slab_from_ct_at_nominal(const CameraGeometry& camera, const PoseFrame& frame) {
  Eigen::Matrix3d room_from_slab_axes;
  room_from_slab_axes.col(0) = camera.column_direction;
  room_from_slab_axes.col(1) = -camera.beam_direction();
  room_from_slab_axes.col(2) = room_from_slab_axes.col(0).cross(room_from_slab_axes.col(1));
  RigidTransform room_from_slab = RigidTransform::Identity();
  room_from_slab.linear() = room_from_slab_axes;
  room_from_slab.translation() = frame.center_room_mm;
  return room_from_slab.inverse() * frame.nominal_room_from_ct();
}

}  // namespace af
