// SPDX-License-Identifier: Apache-2.0
#include "drr/ray_by_ray_af_drr.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "drr/slab_rays.h"

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

/// Values at nodes, by definition or from what has been decoded already.
struct NodeValues {
  const CompressedAttenuationField& field;
  const FieldLevel* decoded;

  [[nodiscard]] float at(std::size_t k, const NodeIndex& node) const {
    return decoded != nullptr ? decoded->node_value(k, node) : field.node_value(k, node);
  }
};

FieldSample nearest_sample(const NodeValues& values, std::size_t k, const RayNodes& nodes) {
  const SlabLattice lattice = values.field.lattice(k);
  FieldSample sample;
  sample.value = static_cast<double>(values.at(k,
                                               {nearest_node(nodes.u, lattice.u.nodes),
                                                nearest_node(nodes.v, lattice.v.nodes),
                                                nearest_node(nodes.s, lattice.s.nodes),
                                                nearest_node(nodes.t, lattice.t.nodes)}));
  return sample;
}

FieldSample quadrilinear_sample(const NodeValues& values, std::size_t k, const RayNodes& nodes) {
  const SlabLattice lattice = values.field.lattice(k);
  const std::array<AxisTap, 4> taps = {axis_tap(nodes.u, lattice.u.nodes),
                                       axis_tap(nodes.v, lattice.v.nodes),
                                       axis_tap(nodes.s, lattice.s.nodes),
                                       axis_tap(nodes.t, lattice.t.nodes)};
  FieldSample sample;
  for (unsigned corner = 0; corner < 16; ++corner) {
    std::array<int, 4> node{};
    std::array<double, 4> weight{};
    for (unsigned axis = 0; axis < 4; ++axis) {
      const bool is_upper = (corner >> axis & 1u) != 0;
      node[axis] = taps[axis].node + (is_upper ? 1 : 0);
      weight[axis] = is_upper ? taps[axis].weight : 1.0 - taps[axis].weight;
    }
    const auto value = static_cast<double>(values.at(k, {node[0], node[1], node[2], node[3]}));
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

/// Derivatives of a ray (slab frame) with respect to the six pose parameters of PoseGradients. When
/// the CT moves by t + R about p, it sees a room point x at x - t - omega x (x - p), to first
/// order.
std::array<Ray, 6> ray_derivatives(const Eigen::Matrix3d& slab_from_room_axes,
                                   const Eigen::Vector3d& source_from_pivot,
                                   const Eigen::Vector3d& direction_in_room) {
  std::array<Ray, 6> derivatives;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
    const auto rotation = static_cast<std::size_t>(axis);
    derivatives[rotation] = {slab_from_room_axes * -unit.cross(source_from_pivot),
                             slab_from_room_axes * -unit.cross(direction_in_room)};
    derivatives[rotation + 3] = {slab_from_room_axes * -unit, Eigen::Vector3d::Zero()};
  }
  return derivatives;
}

}  // namespace

RayByRayAfDrr::RayByRayAfDrr(std::shared_ptr<const CompressedAttenuationField> field,
                             FieldInterpolation interpolation)
    : field_(std::move(field)), interpolation_(interpolation) {
  if (field_->codebook.filter) decoded_ = decode_field(field_);
}

std::unique_ptr<RenderWorkspace> RayByRayAfDrr::make_workspace() const {
  return std::make_unique<RenderWorkspace>();
}

std::int64_t RayByRayAfDrr::rays_outside(const RigidTransform& room_from_ct,
                                         const View& view) const {
  return SlabRays(field_->light_slab, room_from_ct, view).count_outside();
}

RenderStatus RayByRayAfDrr::render(const RigidTransform& room_from_ct,
                                   const View& view,
                                   RenderWorkspace& /*workspace*/,
                                   std::span<float> total_attenuation,
                                   const std::optional<PoseGradients>& gradients) const {
  const std::size_t pixels = view.pixel_count();
  check(total_attenuation.size() == pixels, "one value per pixel of the view");
  check(!gradients || gradients->planes.size() == 6 * pixels,
        "six gradient planes of the view's size");
  const auto& geometry = field_->light_slab;
  const NodeValues values{*field_, decoded_ ? &*decoded_ : nullptr};
  const RigidTransform slab_from_room = geometry.slab_from_ct * room_from_ct.inverse();
  const Eigen::Vector3d source = slab_from_room * view.camera.source_point;
  RenderStatus status;
  std::size_t pixel = 0;
  for (int row = 0; row < view.roi.height; ++row)
    for (int column = 0; column < view.roi.width; ++column, ++pixel) {
      const Eigen::Vector3d direction_in_room =
          view.camera.detector_point(view.roi.column + column, view.roi.row + row) -
          view.camera.source_point;
      const Ray ray{source, slab_from_room.linear() * direction_in_room};  // not normalised
      double value = 0.0;
      std::array<double, 6> slopes{};
      bool is_outside = false;
      for (std::size_t k = 0; k < geometry.slabs.size() && !is_outside; ++k) {
        const auto nodes = geometry.intersect(ray, geometry.slabs[k]);
        if (!nodes) {
          is_outside = true;
          break;
        }
        const FieldSample sample = interpolation_ == FieldInterpolation::Nearest
                                       ? nearest_sample(values, k, *nodes)
                                       : quadrilinear_sample(values, k, *nodes);
        value += sample.value;
        if (!gradients) continue;
        const std::array<Ray, 6> changes =
            ray_derivatives(slab_from_room.linear(),
                            view.camera.source_point - gradients->pivot_room_point,
                            direction_in_room);
        for (std::size_t p = 0; p < 6; ++p)
          slopes[p] += geometry.slope_along(sample.slope, ray, changes[p], geometry.slabs[k]);
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
