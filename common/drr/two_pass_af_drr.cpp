// SPDX-License-Identifier: Apache-2.0
#include "drr/two_pass_af_drr.h"

#include <algorithm>

#include "base/error.h"
#include "base/vector_width.h"
#include "drr/viewpoint_blender.h"
#include "drr/warp_kernel.h"

namespace af {

namespace {

class Workspace final : public RenderWorkspace {
 public:
  BlendScratch scratch;
  std::vector<float> blended;
};

/// Second pass: adds the blended image, resampled to the view's pixels, to `total_attenuation`.
void add_warped(const SlabGeometry& slab,
                const SlabRays& rays,
                const Footprint& footprint,
                const float* blended,
                std::span<float> total_attenuation) {
  const auto add_warped_row = select_kernel<AddWarpedRow>(
      kernels_128::add_warped_row, kernels_256::add_warped_row, kernels_512::add_warped_row);
  const NodeImage image{blended, footprint.s_count(), footprint.t_count()};
  // node = (source + reach * d_x / d_y - first) / spacing, multiplied through by d_y: affine in the
  // column.
  const double reach = slab.st_plane_y_mm - rays.source.y();
  const double s_offset = rays.source.x() - slab.s.position_mm(footprint.s_first);
  const double t_offset = rays.source.z() - slab.t.position_mm(footprint.t_first);
  const auto numerator =
      [&](const Eigen::Vector3d& direction, double offset, int axis, double spacing) {
        return static_cast<float>((offset * direction.y() + reach * direction[axis]) / spacing);
      };
  for (int row = 0; row < rays.roi.height; ++row) {
    const Eigen::Vector3d first = rays.first + row * rays.row_step;
    const WarpRow warp{numerator(first, s_offset, 0, slab.s.spacing_mm()),
                       numerator(rays.column_step, s_offset, 0, slab.s.spacing_mm()),
                       numerator(first, t_offset, 2, slab.t.spacing_mm()),
                       numerator(rays.column_step, t_offset, 2, slab.t.spacing_mm()),
                       static_cast<float>(first.y()),
                       static_cast<float>(rays.column_step.y())};
    add_warped_row(image,
                   warp,
                   total_attenuation.data() + static_cast<std::ptrdiff_t>(row) * rays.roi.width,
                   rays.roi.width);
  }
}

}  // namespace

TwoPassAfDrr::TwoPassAfDrr(std::shared_ptr<const CompressedAttenuationField> field)
    : blender_(make_viewpoint_blender(std::move(field))) {}

TwoPassAfDrr::TwoPassAfDrr(std::shared_ptr<const FieldLevel> level)
    : blender_(make_viewpoint_blender(std::move(level))) {}

std::unique_ptr<RenderWorkspace> TwoPassAfDrr::make_workspace() const {
  return std::make_unique<Workspace>();
}

RenderStatus TwoPassAfDrr::render(const RigidTransform& room_from_ct,
                                  const View& view,
                                  RenderWorkspace& workspace,
                                  std::span<float> total_attenuation,
                                  const std::optional<PoseGradients>& gradients) const {
  check(total_attenuation.size() == view.pixel_count(), "one value per pixel of the view");
  auto& [scratch, blended] = dynamic_cast<Workspace&>(workspace);
  const LightSlab& light_slab = blender_->coverage();
  const SlabRays rays(light_slab.slab_from_ct * room_from_ct.inverse(), view);
  std::fill(total_attenuation.begin(), total_attenuation.end(), 0.0f);
  RenderStatus status;
  if (!rays.all_descend()) {
    status.rays_outside = blank_rays_outside(light_slab, rays, total_attenuation);
    return status;
  }
  for (std::size_t k = 0; k < light_slab.slabs.size(); ++k) {
    const Footprint footprint = footprint_of(blender_->lattice(k), rays);
    const auto nodes = static_cast<std::size_t>(footprint.s_count()) *
                       static_cast<std::size_t>(footprint.t_count());
    if (blended.size() < nodes) blended.resize(nodes);
    blender_->blend(k, rays, footprint, scratch, {blended.data(), nodes});
    add_warped(blender_->lattice(k), rays, footprint, blended.data(), total_attenuation);
  }
  if (!rays.all_inside(light_slab))
    status.rays_outside = blank_rays_outside(light_slab, rays, total_attenuation);
  if (gradients) central_difference_gradients(*this, room_from_ct, view, workspace, *gradients);
  return status;
}

}  // namespace af
