// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/interpolated_ray_cast.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/error.h"
#include "drr/ray_cast_drr.h"

namespace af::evaluation {
namespace {

using Eigen::Vector3d;

/// Interpolation along one axis: lower node and the upper node's weight, in [0, 1].
struct AxisTap {
  int node = 0;
  double weight = 0.0;
};

/// The tap for a coordinate on the axis. Beyond the axis, the nearest end counts.
AxisTap axis_tap(const GridAxis& axis, double position_mm) {
  const double coordinate =
      std::clamp(axis.node_coordinate(position_mm), 0.0, static_cast<double>(axis.nodes - 1));
  const int node = std::min(static_cast<int>(coordinate), axis.nodes - 2);
  return {node, coordinate - node};
}

double weight_of(const AxisTap& tap, int node) {
  if (node == tap.node) return 1.0 - tap.weight;
  return node == tap.node + 1 ? tap.weight : 0.0;
}

/// Casts grids of rays (slab frame) exactly or blended from viewpoints of the lattice.
class GridCaster {
 public:
  GridCaster(const RayCaster& caster, const LightSlab& light_slab)
      : caster_(caster), light_slab_(light_slab) {}

  [[nodiscard]] std::vector<float> exact(const RayFan& fan) const {
    std::vector<float> values(static_cast<std::size_t>(fan.columns) *
                              static_cast<std::size_t>(fan.rows));
    const RigidTransform ct_from_slab = light_slab_.slab_from_ct.inverse();
    RayFan in_ct = fan;
    in_ct.source_point = ct_from_slab * fan.source_point;
    in_ct.first_point = ct_from_slab * fan.first_point;
    in_ct.column_step = ct_from_slab.linear() * fan.column_step;
    in_ct.row_step = ct_from_slab.linear() * fan.row_step;
    caster_.cast(in_ct, values);
    return values;
  }

  /// Every ray blended from the four viewpoints around it, each seeing the ray's own (s,t) point.
  [[nodiscard]] std::vector<float> blended(const RayFan& fan) const {
    const std::vector<std::pair<AxisTap, AxisTap>> taps = viewpoint_taps(fan);
    int last_u = 0;
    int last_v = 0;
    int first_u = light_slab_.u.nodes;
    int first_v = light_slab_.v.nodes;
    for (const auto& [u, v] : taps) {
      first_u = std::min(first_u, u.node);
      first_v = std::min(first_v, v.node);
      last_u = std::max(last_u, u.node + 1);
      last_v = std::max(last_v, v.node + 1);
    }
    std::vector<double> sums(taps.size());
    for (int v = first_v; v <= last_v; ++v)
      for (int u = first_u; u <= last_u; ++u) add_viewpoint(fan, taps, u, v, sums);
    return {sums.begin(), sums.end()};
  }

 private:
  [[nodiscard]] static Vector3d direction(const RayFan& fan, int column, int row) {
    return fan.first_point + column * fan.column_step + row * fan.row_step - fan.source_point;
  }

  [[nodiscard]] std::vector<std::pair<AxisTap, AxisTap>> viewpoint_taps(const RayFan& fan) const {
    std::vector<std::pair<AxisTap, AxisTap>> taps;
    for (int row = 0; row < fan.rows; ++row)
      for (int column = 0; column < fan.columns; ++column) {
        const Vector3d along = direction(fan, column, row);
        const Vector3d at_uv =
            fan.source_point +
            (light_slab_.uv_plane_y_mm - fan.source_point.y()) / along.y() * along;
        taps.emplace_back(axis_tap(light_slab_.u, at_uv.x()), axis_tap(light_slab_.v, at_uv.z()));
      }
    return taps;
  }

  /// The fan from `viewpoint` through the (s,t) points of the given one. With source S, direction D
  /// and h = y_st - S_y, a ray meets the plane at S + (h / D_y) D; seen from V it has the direction
  /// (S - V) D_y / h + D, times h / D_y > 0: affine in column and row, as a fan must be.
  [[nodiscard]] RayFan seen_from(const Vector3d& viewpoint, const RayFan& fan) const {
    const double height = light_slab_.slabs.front().st_plane_y_mm - fan.source_point.y();
    const Vector3d shear = (fan.source_point - viewpoint) / height;
    RayFan seen = fan;
    const Vector3d first = fan.first_point - fan.source_point;
    seen.source_point = viewpoint;
    seen.first_point = viewpoint + first + first.y() * shear;
    seen.column_step = fan.column_step + fan.column_step.y() * shear;
    seen.row_step = fan.row_step + fan.row_step.y() * shear;
    return seen;
  }

  /// Adds the weighted values of one viewpoint, cast over the rows and columns that need it.
  void add_viewpoint(const RayFan& fan,
                     const std::vector<std::pair<AxisTap, AxisTap>>& taps,
                     int u,
                     int v,
                     std::vector<double>& sums) const {
    const auto weight = [&](int column, int row) {
      const auto& tap = taps[static_cast<std::size_t>(row) * static_cast<std::size_t>(fan.columns) +
                             static_cast<std::size_t>(column)];
      return weight_of(tap.first, u) * weight_of(tap.second, v);
    };
    Eigen::AlignedBox2i needed;
    for (int row = 0; row < fan.rows; ++row)
      for (int column = 0; column < fan.columns; ++column)
        if (weight(column, row) > 0.0) needed.extend(Eigen::Vector2i(column, row));
    if (needed.isEmpty()) return;
    RayFan part = seen_from(light_slab_.viewpoint(u, v), fan);
    part.first_point += needed.min().x() * part.column_step + needed.min().y() * part.row_step;
    part.columns = needed.sizes().x() + 1;
    part.rows = needed.sizes().y() + 1;
    const std::vector<float> values = exact(part);
    std::size_t next = 0;
    for (int row = needed.min().y(); row <= needed.max().y(); ++row)
      for (int column = needed.min().x(); column <= needed.max().x(); ++column)
        sums[static_cast<std::size_t>(row) * static_cast<std::size_t>(fan.columns) +
             static_cast<std::size_t>(column)] +=
            weight(column, row) * static_cast<double>(values[next++]);
  }

  const RayCaster& caster_;
  const LightSlab& light_slab_;
};

/// The (s,t) nodes around all pixels.
struct NodeRectangle {
  std::vector<std::pair<AxisTap, AxisTap>> taps;  ///< one pair per pixel
  int first_s = 0;
  int first_t = 0;
  int columns = 0;  ///< along s
  int rows = 0;

  NodeRectangle(const SlabGeometry& slab, const std::vector<Eigen::Vector2d>& st_points) {
    Eigen::AlignedBox2i box;
    for (const Eigen::Vector2d& point : st_points) {
      taps.emplace_back(axis_tap(slab.s, point.x()), axis_tap(slab.t, point.y()));
      const Eigen::Vector2i low(taps.back().first.node, taps.back().second.node);
      box.extend(low).extend(low + Eigen::Vector2i::Ones());
    }
    first_s = box.min().x();
    first_t = box.min().y();
    columns = box.sizes().x() + 1;
    rows = box.sizes().y() + 1;
  }

  [[nodiscard]] RayFan fan(const Vector3d& source, const LightSlab& light_slab) const {
    const SlabGeometry& slab = light_slab.slabs.front();
    return {source,
            light_slab.st_point(slab, first_s, first_t),
            slab.s.spacing_mm() * Vector3d::UnitX(),
            slab.t.spacing_mm() * Vector3d::UnitZ(),
            columns,
            rows};
  }

  void resample(const std::vector<float>& nodes, std::span<float> pixels) const {
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const auto& [s, t] = taps[i];
      const auto first =
          static_cast<std::size_t>(t.node - first_t) * static_cast<std::size_t>(columns) +
          static_cast<std::size_t>(s.node - first_s);
      const auto at = [&](std::size_t offset) {
        return static_cast<double>(nodes[first + offset]);
      };
      const auto width = static_cast<std::size_t>(columns);
      pixels[i] = static_cast<float>(std::lerp(std::lerp(at(0), at(1), s.weight),
                                               std::lerp(at(width), at(width + 1), s.weight),
                                               t.weight));
    }
  }
};

/// The pixels' rays in the slab frame.
RayFan pixel_fan(const LightSlab& light_slab,
                 const RigidTransform& room_from_ct,
                 const View& view) {
  RayFan fan = ray_fan(room_from_ct, view);
  fan.source_point = light_slab.slab_from_ct * fan.source_point;
  fan.first_point = light_slab.slab_from_ct * fan.first_point;
  fan.column_step = light_slab.slab_from_ct.linear() * fan.column_step;
  fan.row_step = light_slab.slab_from_ct.linear() * fan.row_step;
  return fan;
}

}  // namespace

InterpolatedRayCast::InterpolatedRayCast(std::shared_ptr<const AttenuationVolume> volume,
                                         const RayCasterOptions& options,
                                         const LightSlab& light_slab,
                                         InterpolatedPlanes planes)
    : volume_(std::move(volume)),
      caster_(*volume_, options),
      light_slab_(light_slab),
      planes_(planes) {
  check(light_slab_.slabs.size() == 1, "interpolated ray casting is for fields of one slab");
}

InterpolatedRayCast InterpolatedRayCast::on(InterpolatedPlanes planes) const {
  InterpolatedRayCast other = *this;
  other.planes_ = planes;
  return other;
}

std::unique_ptr<RenderWorkspace> InterpolatedRayCast::make_workspace() const {
  return std::make_unique<RenderWorkspace>();
}

RenderStatus InterpolatedRayCast::render(const RigidTransform& room_from_ct,
                                         const View& view,
                                         RenderWorkspace& /*workspace*/,
                                         std::span<float> total_attenuation,
                                         const std::optional<PoseGradients>& gradients) const {
  check(total_attenuation.size() == view.pixel_count(), "one value per pixel of the view");
  check(!gradients, "interpolated ray casting has no gradients");
  const RayFan pixels = pixel_fan(light_slab_, room_from_ct, view);
  const SlabGeometry& slab = light_slab_.slabs.front();
  RenderStatus status;
  std::vector<Eigen::Vector2d> st_points;
  for (int row = 0; row < pixels.rows; ++row)
    for (int column = 0; column < pixels.columns; ++column) {
      const Vector3d direction = pixels.first_point + column * pixels.column_step +
                                 row * pixels.row_step - pixels.source_point;
      if (!light_slab_.intersect({pixels.source_point, direction}, slab)) ++status.rays_outside;
      const Vector3d at_st = pixels.source_point + (slab.st_plane_y_mm - pixels.source_point.y()) /
                                                       direction.y() * direction;
      st_points.emplace_back(at_st.x(), at_st.z());
    }
  std::fill(total_attenuation.begin(), total_attenuation.end(), 0.0f);
  if (!status.is_inside()) return status;
  const GridCaster grid(caster_, light_slab_);
  if (planes_ == InterpolatedPlanes::Uv) {
    const std::vector<float> values = grid.blended(pixels);
    std::copy(values.begin(), values.end(), total_attenuation.begin());
    return status;
  }
  const NodeRectangle nodes(slab, st_points);
  const RayFan fan = nodes.fan(pixels.source_point, light_slab_);
  nodes.resample(planes_ == InterpolatedPlanes::St ? grid.exact(fan) : grid.blended(fan),
                 total_attenuation);
  return status;
}

}  // namespace af::evaluation
