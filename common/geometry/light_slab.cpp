// SPDX-License-Identifier: Apache-2.0
#include "geometry/light_slab.h"

#include <cmath>

namespace af {

namespace {

/// Derivative of the point where a ray meets the plane y = plane_y_mm, as the ray changes.
Eigen::Vector3d hit_derivative(const Ray& ray, double plane_y_mm, const Ray& change) {
  const double scale = (plane_y_mm - ray.origin_point.y()) / ray.direction.y();
  const double d_scale =
      (-change.origin_point.y() - scale * change.direction.y()) / ray.direction.y();
  return change.origin_point + scale * change.direction + d_scale * ray.direction;
}

void append_extent_problems(const std::string& name,
                            const GridAxis& axis,
                            std::vector<std::string>& found) {
  if (!(std::isfinite(axis.first_mm) && std::isfinite(axis.last_mm) &&
        axis.last_mm > axis.first_mm))
    found.push_back(name + " extent: must be finite and ascending");
}

}  // namespace

std::optional<RayNodes> LightSlab::intersect(const Ray& ray_in_slab,
                                             const SlabGeometry& slab) const {
  const Eigen::Vector3d& origin = ray_in_slab.origin_point;
  const Eigen::Vector3d& direction = ray_in_slab.direction;
  if (!(direction.y() < 0.0) || !lies_before(origin.y(), slab)) return std::nullopt;
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

double LightSlab::slope_along(const std::array<double, 4>& slopes,
                              const Ray& ray_in_slab,
                              const Ray& change,
                              const SlabGeometry& slab) const {
  const Eigen::Vector3d at_uv = hit_derivative(ray_in_slab, uv_plane_y_mm, change);
  const Eigen::Vector3d at_st = hit_derivative(ray_in_slab, slab.st_plane_y_mm, change);
  return slopes[0] * at_uv.x() / u.spacing_mm() + slopes[1] * at_uv.z() / v.spacing_mm() +
         slopes[2] * at_st.x() / slab.s.spacing_mm() + slopes[3] * at_st.z() / slab.t.spacing_mm();
}

FieldLattice LightSlab::lattice() const {
  FieldLattice all;
  for (std::size_t k = 0; k < slabs.size(); ++k) all.slabs.push_back(lattice(k));
  return all;
}

std::vector<std::string> problems(const LightSlab& light_slab) {
  std::vector<std::string> found = rigidity_problems(light_slab.slab_from_ct.matrix());
  append_extent_problems("u", light_slab.u, found);
  append_extent_problems("v", light_slab.v, found);
  for (std::size_t k = 0; k < light_slab.slabs.size(); ++k) {
    const SlabGeometry& slab = light_slab.slabs[k];
    const std::string name = "slab " + std::to_string(k);
    append_extent_problems(name + " s", slab.s, found);
    append_extent_problems(name + " t", slab.t, found);
    if (!(slab.st_plane_y_mm < light_slab.uv_plane_y_mm))
      found.push_back(name + " st_plane_y_mm: must lie below the (u,v) plane");
    const std::vector<std::string> of_lattice = problems(light_slab.lattice(k), name);
    found.insert(found.end(), of_lattice.begin(), of_lattice.end());
  }
  return found;
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
