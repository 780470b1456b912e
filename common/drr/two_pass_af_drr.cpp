// SPDX-License-Identifier: Apache-2.0
#include "drr/two_pass_af_drr.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/vector_width.h"
#include "drr/warp_kernel.h"

namespace af {

namespace {

/// Blending of two neighbouring viewpoint nodes along one axis, for one (s,t) node: where their
/// tiles and elements are.
struct ViewpointTap {
  std::size_t lower_tile;  ///< offset of the lower viewpoint's tiles in the index array
  std::size_t upper_tile;
  std::uint32_t lower_element;
  std::uint32_t upper_element;
  float weight;  ///< of the upper viewpoint
};

/// Nodes of the (s,t) lattice that a view's rays need, both ends included.
struct Footprint {
  int s_first, s_last;
  int t_first, t_last;

  [[nodiscard]] int s_count() const { return s_last - s_first + 1; }
  [[nodiscard]] int t_count() const { return t_last - t_first + 1; }
};

class Workspace final : public RenderWorkspace {
 public:
  std::vector<float> blended;
  std::vector<ViewpointTap> u_taps;
  std::vector<ViewpointTap> v_taps;
};

/// The view's rays in the slab frame: from `source` along first + column * column_step + row *
/// row_step.
struct SlabRays {
  Eigen::Vector3d source;
  Eigen::Vector3d first;
  Eigen::Vector3d column_step;
  Eigen::Vector3d row_step;
};

SlabRays slab_rays(const RigidTransform& slab_from_room, const View& view) {
  const CameraGeometry& camera = view.camera;
  const Eigen::Vector3d source = slab_from_room * camera.source_point;
  return {source,
          slab_from_room * camera.detector_point(view.roi.column, view.roi.row) - source,
          slab_from_room.linear() * (camera.pixel_spacing_mm.x() * camera.column_direction),
          slab_from_room.linear() * (camera.pixel_spacing_mm.y() * camera.row_direction)};
}

std::array<Eigen::Vector3d, 4> corner_directions(const SlabRays& rays,
                                                 const RegionOfInterest& roi) {
  const Eigen::Vector3d right = (roi.width - 1) * rays.column_step;
  const Eigen::Vector3d down = (roi.height - 1) * rays.row_step;
  return {rays.first, rays.first + right, rays.first + down, rays.first + right + down};
}

/// The hit points of a view's rays form a convex quadrilateral on each plane, so its corner rays
/// decide.
bool all_rays_inside(const LightSlab& light_slab,
                     const SlabRays& rays,
                     const RegionOfInterest& roi) {
  for (const Eigen::Vector3d& direction : corner_directions(rays, roi))
    for (const SlabGeometry& slab : light_slab.slabs)
      if (!light_slab.intersect({rays.source, direction}, slab)) return false;
  return true;
}

/// Bounding box of the stored nodes that the view's rays touch; at least 2 x 2 nodes.
Footprint footprint_of(const SlabGeometry& slab,
                       const SlabRays& rays,
                       const RegionOfInterest& roi) {
  std::array<double, 4> bounds{1e300, -1e300, 1e300, -1e300};
  for (const Eigen::Vector3d& direction : corner_directions(rays, roi)) {
    const double scale = (slab.st_plane_y_mm - rays.source.y()) / direction.y();
    const double s = slab.s.node_coordinate(rays.source.x() + scale * direction.x());
    const double t = slab.t.node_coordinate(rays.source.z() + scale * direction.z());
    bounds = {std::min(bounds[0], s),
              std::max(bounds[1], s),
              std::min(bounds[2], t),
              std::max(bounds[3], t)};
  }
  const auto lower = [](double coordinate, int nodes) {
    return std::clamp(static_cast<int>(std::floor(coordinate)), 0, nodes - 2);
  };
  Footprint footprint{lower(bounds[0], slab.s.nodes), 0, lower(bounds[2], slab.t.nodes), 0};
  footprint.s_last =
      std::clamp(static_cast<int>(std::ceil(bounds[1])), footprint.s_first + 1, slab.s.nodes - 1);
  footprint.t_last =
      std::clamp(static_cast<int>(std::ceil(bounds[3])), footprint.t_first + 1, slab.t.nodes - 1);
  return footprint;
}

/// Taps for the (s or t) nodes first ... last: the ray from the source through node position p
/// meets the (u,v) plane at source + ratio * (p - source), on each axis by itself.
void make_taps(const GridAxis& node_axis,
               int first,
               int last,
               double source_mm,
               double ratio,
               const GridAxis& viewpoint_axis,
               std::size_t tile_stride,
               std::uint32_t element_stride,
               std::vector<ViewpointTap>& taps) {
  taps.clear();
  for (int node = first; node <= last; ++node) {
    const double at_mm = source_mm + ratio * (node_axis.position_mm(node) - source_mm);
    // Nodes just outside the outermost rays can ask for a viewpoint just outside the rectangle.
    const double coordinate =
        std::clamp(viewpoint_axis.node_coordinate(at_mm), 0.0, viewpoint_axis.nodes - 1.0);
    const int lower = std::min(static_cast<int>(coordinate), viewpoint_axis.nodes - 2);
    const auto tile_of = [&](int viewpoint) {
      return static_cast<std::size_t>(viewpoint / 2) * tile_stride;
    };
    const auto element_of = [&](int viewpoint) {
      return static_cast<std::uint32_t>(viewpoint % 2) * element_stride;
    };
    taps.push_back({tile_of(lower),
                    tile_of(lower + 1),
                    element_of(lower),
                    element_of(lower + 1),
                    static_cast<float>(coordinate - lower)});
  }
}

/// First pass: the image of blended viewpoints over the footprint, t fastest; nodes that are not
/// stored are 0.
void blend_viewpoints(const CompressedAttenuationField& field,
                      std::size_t k,
                      const SlabRays& rays,
                      const Footprint& footprint,
                      Workspace& workspace) {
  const LightSlab& light_slab = field.light_slab;
  const SlabGeometry& slab = light_slab.slabs[k];
  const double ratio =
      (light_slab.uv_plane_y_mm - rays.source.y()) / (slab.st_plane_y_mm - rays.source.y());
  const auto t_tiles = static_cast<std::size_t>(slab.stored_t.tiles());
  const std::size_t st_tiles = static_cast<std::size_t>(slab.stored_s.tiles()) * t_tiles;
  const int s_begin = std::max(footprint.s_first, slab.stored_s.begin);
  const int s_end = std::min(footprint.s_last + 1, slab.stored_s.end());
  const int t_begin = std::max(footprint.t_first, slab.stored_t.begin);
  const int t_end = std::min(footprint.t_last + 1, slab.stored_t.end());
  const auto t_count = static_cast<std::size_t>(footprint.t_count());
  workspace.blended.assign(static_cast<std::size_t>(footprint.s_count()) * t_count, 0.0f);
  if (s_begin >= s_end || t_begin >= t_end) return;

  make_taps(slab.s,
            s_begin,
            s_end - 1,
            rays.source.x(),
            ratio,
            light_slab.u,
            static_cast<std::size_t>(field.tiles_v()) * st_tiles,
            tile_element(1, 0, 0, 0),
            workspace.u_taps);
  make_taps(slab.t,
            t_begin,
            t_end - 1,
            rays.source.z(),
            ratio,
            light_slab.v,
            st_tiles,
            tile_element(0, 1, 0, 0),
            workspace.v_taps);
  const std::uint16_t* indices = field.slabs[k].indices.data();
  const Tile* codewords = field.codebook.codewords.data();
  for (int s = s_begin; s < s_end; ++s) {
    const ViewpointTap& u = workspace.u_taps[static_cast<std::size_t>(s - s_begin)];
    const auto local_s = static_cast<std::size_t>(s - slab.stored_s.begin);
    const std::size_t s_element = tile_element(0, 0, local_s & 1u, 0);
    float* row =
        workspace.blended.data() + static_cast<std::size_t>(s - footprint.s_first) * t_count;
    for (int t = t_begin; t < t_end; ++t) {
      const ViewpointTap& v = workspace.v_taps[static_cast<std::size_t>(t - t_begin)];
      const auto local_t = static_cast<std::size_t>(t - slab.stored_t.begin);
      const std::uint16_t* at = indices + (local_s / 2) * t_tiles + local_t / 2;
      const std::size_t element = s_element + (local_t & 1u);
      const auto level = [&](std::size_t u_tile, std::size_t v_tile, std::size_t uv_element) {
        return static_cast<float>(codewords[at[u_tile + v_tile]][element + uv_element]);
      };
      const float low = level(u.lower_tile, v.lower_tile, u.lower_element + v.lower_element);
      const float low_up = level(u.lower_tile, v.upper_tile, u.lower_element + v.upper_element);
      const float up = level(u.upper_tile, v.lower_tile, u.upper_element + v.lower_element);
      const float up_up = level(u.upper_tile, v.upper_tile, u.upper_element + v.upper_element);
      const float at_low_u = low + v.weight * (low_up - low);
      const float at_up_u = up + v.weight * (up_up - up);
      row[t - footprint.t_first] =
          field.quantizer_step * (at_low_u + u.weight * (at_up_u - at_low_u));
    }
  }
}

/// Second pass: adds the blended image, resampled to the view's pixels, to `total_attenuation`.
void add_warped(const SlabGeometry& slab,
                const SlabRays& rays,
                const RegionOfInterest& roi,
                const Footprint& footprint,
                const std::vector<float>& blended,
                AddWarpedRow add_warped_row,
                std::span<float> total_attenuation) {
  const NodeImage image{blended.data(), footprint.s_count(), footprint.t_count()};
  // node = (source + reach * d_x / d_y - first) / spacing, multiplied through by d_y: affine in the
  // column.
  const double reach = slab.st_plane_y_mm - rays.source.y();
  const double s_offset = rays.source.x() - slab.s.position_mm(footprint.s_first);
  const double t_offset = rays.source.z() - slab.t.position_mm(footprint.t_first);
  const auto numerator =
      [&](const Eigen::Vector3d& direction, double offset, int axis, double spacing) {
        return static_cast<float>((offset * direction.y() + reach * direction[axis]) / spacing);
      };
  for (int row = 0; row < roi.height; ++row) {
    const Eigen::Vector3d first = rays.first + row * rays.row_step;
    const WarpRow warp{numerator(first, s_offset, 0, slab.s.spacing_mm()),
                       numerator(rays.column_step, s_offset, 0, slab.s.spacing_mm()),
                       numerator(first, t_offset, 2, slab.t.spacing_mm()),
                       numerator(rays.column_step, t_offset, 2, slab.t.spacing_mm()),
                       static_cast<float>(first.y()),
                       static_cast<float>(rays.column_step.y())};
    add_warped_row(image,
                   warp,
                   total_attenuation.data() + static_cast<std::ptrdiff_t>(row) * roi.width,
                   roi.width);
  }
}

/// Zeroes and counts the rays that miss a plane.
std::int64_t blank_rays_outside(const LightSlab& light_slab,
                                const SlabRays& rays,
                                const RegionOfInterest& roi,
                                std::span<float> total_attenuation) {
  std::int64_t outside = 0;
  std::size_t pixel = 0;
  for (int row = 0; row < roi.height; ++row)
    for (int column = 0; column < roi.width; ++column, ++pixel) {
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

}  // namespace

TwoPassAfDrr::TwoPassAfDrr(std::shared_ptr<const CompressedAttenuationField> field)
    : field_(std::move(field)) {}

std::unique_ptr<RenderWorkspace> TwoPassAfDrr::make_workspace() const {
  return std::make_unique<Workspace>();
}

RenderStatus TwoPassAfDrr::render(const RigidTransform& room_from_ct,
                                  const View& view,
                                  RenderWorkspace& workspace,
                                  std::span<float> total_attenuation,
                                  const std::optional<PoseGradients>& gradients) const {
  check(total_attenuation.size() == view.pixel_count(), "one value per pixel of the view");
  auto& scratch = dynamic_cast<Workspace&>(workspace);
  const LightSlab& light_slab = field_->light_slab;
  const SlabRays rays = slab_rays(light_slab.slab_from_ct * room_from_ct.inverse(), view);
  std::fill(total_attenuation.begin(), total_attenuation.end(), 0.0f);
  RenderStatus status;
  const auto descends = [&] {
    const auto corners = corner_directions(rays, view.roi);
    return std::all_of(
        corners.begin(), corners.end(), [](const Eigen::Vector3d& d) { return d.y() < 0.0; });
  };
  if (!descends()) {
    status.rays_outside = blank_rays_outside(light_slab, rays, view.roi, total_attenuation);
    return status;
  }
  const auto add_warped_row = select_kernel<AddWarpedRow>(
      kernels_128::add_warped_row, kernels_256::add_warped_row, kernels_512::add_warped_row);
  for (std::size_t k = 0; k < light_slab.slabs.size(); ++k) {
    const Footprint footprint = footprint_of(light_slab.slabs[k], rays, view.roi);
    blend_viewpoints(*field_, k, rays, footprint, scratch);
    add_warped(light_slab.slabs[k],
               rays,
               view.roi,
               footprint,
               scratch.blended,
               add_warped_row,
               total_attenuation);
  }
  if (!all_rays_inside(light_slab, rays, view.roi))
    status.rays_outside = blank_rays_outside(light_slab, rays, view.roi, total_attenuation);
  if (gradients) central_difference_gradients(*this, room_from_ct, view, workspace, *gradients);
  return status;
}

}  // namespace af
