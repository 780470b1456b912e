// SPDX-License-Identifier: Apache-2.0
#include "drr/af_drr.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"

namespace af {

namespace {

/// Interpolation along one axis: lower node and the upper node's weight, in [0, 1].
struct AxisTap {
  int node;
  double weight;
};

AxisTap axis_tap(double node_coordinate, int nodes) {
  const int node = std::clamp(static_cast<int>(node_coordinate), 0, nodes - 2);
  return {node, node_coordinate - node};
}

int nearest_node(double node_coordinate, int nodes) {
  return std::clamp(static_cast<int>(std::floor(node_coordinate + 0.5)), 0, nodes - 1);
}

/// Value and derivatives with respect to the node coordinates (u, v, s, t).
struct FieldSample {
  double value = 0.0;
  std::array<double, 4> slope = {0.0, 0.0, 0.0, 0.0};
};

FieldSample nearest_sample(const CompressedAttenuationField& field,
                           std::size_t k,
                           const RayNodes& nodes) {
  const LightSlab& light_slab = field.light_slab;
  const SlabGeometry& slab = light_slab.slabs[k];
  FieldSample sample;
  sample.value = static_cast<double>(field.node_value(k,
                                                      {nearest_node(nodes.u, light_slab.u.nodes),
                                                       nearest_node(nodes.v, light_slab.v.nodes),
                                                       nearest_node(nodes.s, slab.s.nodes),
                                                       nearest_node(nodes.t, slab.t.nodes)}));
  return sample;
}

FieldSample quadrilinear_sample(const CompressedAttenuationField& field,
                                std::size_t k,
                                const RayNodes& nodes) {
  const LightSlab& light_slab = field.light_slab;
  const SlabGeometry& slab = light_slab.slabs[k];
  const std::array<AxisTap, 4> taps = {axis_tap(nodes.u, light_slab.u.nodes),
                                       axis_tap(nodes.v, light_slab.v.nodes),
                                       axis_tap(nodes.s, slab.s.nodes),
                                       axis_tap(nodes.t, slab.t.nodes)};
  FieldSample sample;
  for (unsigned corner = 0; corner < 16; ++corner) {
    std::array<int, 4> node{};
    std::array<double, 4> weight{};
    for (unsigned axis = 0; axis < 4; ++axis) {
      const bool is_upper = (corner >> axis & 1u) != 0;
      node[axis] = taps[axis].node + (is_upper ? 1 : 0);
      weight[axis] = is_upper ? taps[axis].weight : 1.0 - taps[axis].weight;
    }
    const auto value =
        static_cast<double>(field.node_value(k, {node[0], node[1], node[2], node[3]}));
    sample.value += weight[0] * weight[1] * weight[2] * weight[3] * value;
    for (unsigned axis = 0; axis < 4; ++axis) {
      double others = (corner >> axis & 1u) != 0 ? value : -value;
      for (unsigned other = 0; other < 4; ++other)
        if (other != axis) others *= weight[other];
      sample.slope[axis] += others;
    }
  }
  return sample;
}

/// A ray of the view in the slab frame: from the source through a detector point.
struct SlabRay {
  Eigen::Vector3d source;
  Eigen::Vector3d direction;  ///< not normalised
};

/// Derivatives of the ray's source and direction (slab frame) with respect to the six pose
/// parameters of PoseGradients.
struct RayDerivatives {
  std::array<Eigen::Vector3d, 6> source;
  std::array<Eigen::Vector3d, 6> direction;
};

/// A CT moved by t + R about p sees a room point x at x - t - omega x (x - p), to first order.
RayDerivatives ray_derivatives(const Eigen::Matrix3d& slab_from_room_axes,
                               const Eigen::Vector3d& source_from_pivot,
                               const Eigen::Vector3d& direction_in_room) {
  RayDerivatives derivatives;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
    const auto rotation = static_cast<std::size_t>(axis);
    derivatives.source[rotation] = slab_from_room_axes * -unit.cross(source_from_pivot);
    derivatives.direction[rotation] = slab_from_room_axes * -unit.cross(direction_in_room);
    derivatives.source[rotation + 3] = slab_from_room_axes * -unit;
    derivatives.direction[rotation + 3] = Eigen::Vector3d::Zero();
  }
  return derivatives;
}

/// Derivative of where a ray meets the plane y = plane_y, as the ray changes.
Eigen::Vector3d hit_derivative(const SlabRay& ray,
                               double plane_y,
                               const Eigen::Vector3d& d_source,
                               const Eigen::Vector3d& d_direction) {
  const double scale = (plane_y - ray.source.y()) / ray.direction.y();
  const double d_scale = (-d_source.y() - scale * d_direction.y()) / ray.direction.y();
  return d_source + scale * d_direction + d_scale * ray.direction;
}

}  // namespace

AfDrr::AfDrr(std::shared_ptr<const CompressedAttenuationField> field,
             FieldInterpolation interpolation)
    : field_(std::move(field)), interpolation_(interpolation) {}

std::unique_ptr<RenderWorkspace> AfDrr::make_workspace() const {
  return std::make_unique<RenderWorkspace>();
}

RenderStatus AfDrr::render(const RigidTransform& room_from_ct,
                           const View& view,
                           RenderWorkspace& /*workspace*/,
                           std::span<float> total_attenuation,
                           const std::optional<PoseGradients>& gradients) const {
  const std::size_t pixels = view.pixel_count();
  check(total_attenuation.size() == pixels, "one value per pixel of the view");
  check(!gradients || gradients->planes.size() == 6 * pixels,
        "six gradient planes of the view's size");
  const LightSlab& light_slab = field_->light_slab;
  const RigidTransform slab_from_room = light_slab.slab_from_ct * room_from_ct.inverse();
  const Eigen::Vector3d source = slab_from_room * view.camera.source_point;
  RenderStatus status;
  std::size_t pixel = 0;
  for (int row = 0; row < view.roi.height; ++row)
    for (int column = 0; column < view.roi.width; ++column, ++pixel) {
      const Eigen::Vector3d direction_in_room =
          view.camera.detector_point(view.roi.column + column, view.roi.row + row) -
          view.camera.source_point;
      const SlabRay ray{source, slab_from_room.linear() * direction_in_room};
      double value = 0.0;
      std::array<double, 6> slopes{};
      bool is_outside = false;
      for (std::size_t k = 0; k < light_slab.slabs.size() && !is_outside; ++k) {
        const SlabGeometry& slab = light_slab.slabs[k];
        const auto nodes = light_slab.intersect({ray.source, ray.direction}, slab);
        if (!nodes) {
          is_outside = true;
          break;
        }
        const FieldSample sample = interpolation_ == FieldInterpolation::Nearest
                                       ? nearest_sample(*field_, k, *nodes)
                                       : quadrilinear_sample(*field_, k, *nodes);
        value += sample.value;
        if (!gradients) continue;
        const RayDerivatives change =
            ray_derivatives(slab_from_room.linear(),
                            view.camera.source_point - gradients->pivot_room_point,
                            direction_in_room);
        for (std::size_t p = 0; p < 6; ++p) {
          const Eigen::Vector3d at_uv =
              hit_derivative(ray, light_slab.uv_plane_y_mm, change.source[p], change.direction[p]);
          const Eigen::Vector3d at_st =
              hit_derivative(ray, slab.st_plane_y_mm, change.source[p], change.direction[p]);
          slopes[p] += sample.slope[0] * at_uv.x() / light_slab.u.spacing_mm() +
                       sample.slope[1] * at_uv.z() / light_slab.v.spacing_mm() +
                       sample.slope[2] * at_st.x() / slab.s.spacing_mm() +
                       sample.slope[3] * at_st.z() / slab.t.spacing_mm();
        }
      }
      status.rays_outside += is_outside ? 1 : 0;
      total_attenuation[pixel] = is_outside ? 0.0f : static_cast<float>(value);
      if (!gradients) continue;
      for (std::size_t p = 0; p < 6; ++p)
        gradients->planes[p * pixels + pixel] = is_outside ? 0.0f : static_cast<float>(slopes[p]);
    }
  return status;
}

}  // namespace af
