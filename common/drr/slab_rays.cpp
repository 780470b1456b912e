// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_rays.h"

#include <algorithm>
#include <cmath>

namespace af {

SlabRays::SlabRays(const LightSlab& light_slab,
                   const RigidTransform& room_from_ct,
                   const View& view)
    : slab_from_room(light_slab.slab_from_ct * room_from_ct.inverse()),
      source(slab_from_room * view.camera.source_point),
      first(slab_from_room * view.camera.detector_point(view.roi.column, view.roi.row) - source),
      column_step(slab_from_room.linear() *
                  (view.camera.pixel_spacing_mm.x() * view.camera.column_direction)),
      row_step(slab_from_room.linear() *
               (view.camera.pixel_spacing_mm.y() * view.camera.row_direction)),
      roi(view.roi),
      light_slab_(light_slab) {}

std::array<Eigen::Vector3d, 4> SlabRays::corner_directions() const {
  const Eigen::Vector3d right = (roi.width - 1) * column_step;
  const Eigen::Vector3d down = (roi.height - 1) * row_step;
  return {first, first + right, first + down, first + right + down};
}

bool SlabRays::all_cross() const {
  const auto corners = corner_directions();
  return source.allFinite() &&
         std::ranges::all_of(
             light_slab_.slabs,
             [&](const SlabGeometry& slab) { return light_slab_.lies_before(source.y(), slab); }) &&
         std::ranges::all_of(corners,
                             [](const Eigen::Vector3d& d) { return d.allFinite() && d.y() < 0.0; });
}

bool SlabRays::is_inside(const Eigen::Vector3d& direction) const {
  return std::all_of(
      light_slab_.slabs.begin(), light_slab_.slabs.end(), [&](const SlabGeometry& slab) {
        return light_slab_.intersect({source, direction}, slab).has_value();
      });
}

bool SlabRays::all_inside() const {
  const auto corners = corner_directions();
  return std::all_of(
      corners.begin(), corners.end(), [&](const Eigen::Vector3d& d) { return is_inside(d); });
}

std::array<double, 4> SlabRays::shares_to_edges() const {
  if (!all_cross()) return {-1.0, -1.0, -1.0, -1.0};
  std::array<double, 4> least = {0.5, 0.5, 0.5, 0.5};
  const auto keep = [&](std::size_t i, const GridAxis& axis, double position_mm) {
    const double distance_mm = std::min(position_mm - axis.first_mm, axis.last_mm - position_mm);
    least[i] = std::min(least[i], distance_mm / (axis.last_mm - axis.first_mm));
  };
  for (const Eigen::Vector3d& direction : corner_directions()) {
    const Eigen::Vector3d on_uv = hit(light_slab_.uv_plane_y_mm, direction);
    keep(0, light_slab_.u, on_uv.x());
    keep(1, light_slab_.v, on_uv.z());
    for (const SlabGeometry& slab : light_slab_.slabs) {
      const Eigen::Vector3d on_st = hit(slab.st_plane_y_mm, direction);
      keep(2, slab.s, on_st.x());
      keep(3, slab.t, on_st.z());
    }
  }
  return least;
}

double SlabRays::share_to_edges() const {
  const std::array<double, 4> shares = shares_to_edges();
  return *std::min_element(shares.begin(), shares.end());
}

std::int64_t SlabRays::count_outside() const {
  if (all_cross() && all_inside()) return 0;
  return blank_outside({});
}

std::int64_t SlabRays::blank_outside(std::span<float> planes, std::span<float> more_planes) const {
  std::int64_t outside = 0;
  std::size_t pixel = 0;
  for (int row = 0; row < roi.height; ++row)
    for (int column = 0; column < roi.width; ++column, ++pixel) {
      if (is_inside(first + column * column_step + row * row_step)) continue;
      for (const std::span<float>& output : {planes, more_planes})
        for (std::size_t at = pixel; at < output.size(); at += roi.pixel_count()) output[at] = 0.0f;
      ++outside;
    }
  return outside;
}

namespace {

/// Nodes around coordinates low ... high, within the lattice. At least two.
NodeRange nodes_around(double low, double high, int nodes, const Footprint::Needs& needs) {
  // Clamped before rounding, because rays that miss the plane can be anywhere.
  const int lower = static_cast<int>(std::floor(std::clamp(low, 0.0, nodes - 2.0)));
  const int upper = static_cast<int>(std::ceil(std::clamp(high, lower + 1.0, nodes - 1.0)));
  int begin = std::max(0, lower - needs.margin);
  int end = std::min(nodes, upper + 1 + needs.margin);
  if (needs.whole_tiles) {
    begin -= begin % 2;
    end += end % 2;
  }
  return {begin, end - begin};
}

}  // namespace

Footprint::Footprint(const SlabGeometry& slab, const SlabRays& rays, const Needs& needs)
    : margin_(needs.margin) {
  const auto directions = rays.corner_directions();
  std::array<double, 2> low{1e300, 1e300};
  std::array<double, 2> high{-1e300, -1e300};
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d& direction = directions[i == 2 ? 3 : (i == 3 ? 2 : i)];
    const Eigen::Vector3d hit = rays.hit(slab.st_plane_y_mm, direction);
    corners_[i] = {slab.s.node_coordinate(hit.x()), slab.t.node_coordinate(hit.z())};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      low[axis] = std::min(low[axis], corners_[i][axis]);
      high[axis] = std::max(high[axis], corners_[i][axis]);
    }
  }
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double run = corners_[(i + 1) % 4][axis] - corners_[i][axis];
      const double rise = corners_[(i + 1) % 4][1 - axis] - corners_[i][1 - axis];
      side_slopes_[i][axis] = run == 0.0 ? 0.0 : rise / run;
    }
  s_ = nodes_around(low[0], high[0], slab.s.nodes, needs);
  t_ = nodes_around(low[1], high[1], slab.t.nodes, needs);
}

NodeRange Footprint::t_needed(const NodeRange& s) const {
  return needed(s, 0);
}

NodeRange Footprint::s_needed(const NodeRange& t) const {
  return needed(t, 1);
}

NodeRange Footprint::needed(const NodeRange& across, std::size_t axis) const {
  const NodeRange& box_across = axis == 0 ? s_ : t_;
  const NodeRange& box = axis == 0 ? t_ : s_;
  // A node serves the cells on both of its sides. Coordinates beyond the box are clamped to its
  // edge.
  constexpr double kRounding = 1e-3;
  double first = across.begin - 1 - margin_ - kRounding;
  double last = across.end() + margin_ + kRounding;
  if (across.begin <= box_across.begin) first = -1e300;
  if (across.end() >= box_across.end()) last = 1e300;
  double low = 1e300;
  double high = -1e300;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& from = corners_[i];
    const double to = corners_[(i + 1) % 4][axis];
    if (std::min(from[axis], to) > last || std::max(from[axis], to) < first) continue;
    for (const double end : {from[axis], to}) {
      const double at = std::clamp(end, first, last);
      const double other = from[1 - axis] + side_slopes_[i][axis] * (at - from[axis]);
      low = std::min(low, other);
      high = std::max(high, other);
    }
  }
  if (low > high) return {box.begin, 0};
  const auto lower_node = [&](double coordinate) {
    return static_cast<int>(
        std::floor(std::clamp(coordinate, static_cast<double>(box.begin), box.end() - 2.0)));
  };
  const int begin = std::max(box.begin, lower_node(low - kRounding) - margin_);
  const int end = std::min(box.end(), lower_node(high + kRounding) + 2 + margin_);
  return {begin, end - begin};
}

}  // namespace af
