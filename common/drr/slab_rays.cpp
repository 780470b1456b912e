// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_rays.h"

#include <algorithm>
#include <cmath>

namespace af {

SlabRays::SlabRays(const RigidTransform& slab_from_room, const View& view)
    : source(slab_from_room * view.camera.source_point),
      first(slab_from_room * view.camera.detector_point(view.roi.column, view.roi.row) - source),
      column_step(slab_from_room.linear() *
                  (view.camera.pixel_spacing_mm.x() * view.camera.column_direction)),
      row_step(slab_from_room.linear() *
               (view.camera.pixel_spacing_mm.y() * view.camera.row_direction)),
      roi(view.roi) {}

std::array<Eigen::Vector3d, 4> SlabRays::corner_directions() const {
  const Eigen::Vector3d right = (roi.width - 1) * column_step;
  const Eigen::Vector3d down = (roi.height - 1) * row_step;
  return {first, first + right, first + down, first + right + down};
}

bool SlabRays::all_descend() const {
  const auto corners = corner_directions();
  return std::all_of(
      corners.begin(), corners.end(), [](const Eigen::Vector3d& d) { return d.y() < 0.0; });
}

bool SlabRays::all_inside(const LightSlab& light_slab) const {
  for (const Eigen::Vector3d& direction : corner_directions())
    for (const SlabGeometry& slab : light_slab.slabs)
      if (!light_slab.intersect({source, direction}, slab)) return false;
  return true;
}

Footprint footprint_of(const SlabGeometry& slab, const SlabRays& rays) {
  std::array<double, 4> bounds{1e300, -1e300, 1e300, -1e300};
  for (const Eigen::Vector3d& direction : rays.corner_directions()) {
    const double scale = (slab.st_plane_y_mm - rays.source.y()) / direction.y();
    const double s = slab.s.node_coordinate(rays.source.x() + scale * direction.x());
    const double t = slab.t.node_coordinate(rays.source.z() + scale * direction.z());
    bounds = {std::min(bounds[0], s),
              std::max(bounds[1], s),
              std::min(bounds[2], t),
              std::max(bounds[3], t)};
  }
  // Clamped before rounding: rays that miss the plane can be anywhere.
  const auto lower = [](double coordinate, int nodes) {
    return static_cast<int>(std::floor(std::clamp(coordinate, 0.0, nodes - 2.0)));
  };
  const auto upper = [](double coordinate, int first, int nodes) {
    return static_cast<int>(std::ceil(std::clamp(coordinate, first + 1.0, nodes - 1.0)));
  };
  Footprint footprint;
  footprint.s_first = lower(bounds[0], slab.s.nodes);
  footprint.t_first = lower(bounds[2], slab.t.nodes);
  footprint.s_last = upper(bounds[1], footprint.s_first, slab.s.nodes);
  footprint.t_last = upper(bounds[3], footprint.t_first, slab.t.nodes);
  return footprint;
}

std::int64_t blank_rays_outside(const LightSlab& light_slab,
                                const SlabRays& rays,
                                std::span<float> total_attenuation) {
  std::int64_t outside = 0;
  std::size_t pixel = 0;
  for (int row = 0; row < rays.roi.height; ++row)
    for (int column = 0; column < rays.roi.width; ++column, ++pixel) {
      const Ray ray{rays.source, rays.first + column * rays.column_step + row * rays.row_step};
      const bool is_inside = std::all_of(
          light_slab.slabs.begin(), light_slab.slabs.end(), [&](const SlabGeometry& slab) {
            return light_slab.intersect(ray, slab).has_value();
          });
      if (is_inside) continue;
      total_attenuation[pixel] = 0.0f;
      ++outside;
    }
  return outside;
}

}  // namespace af
