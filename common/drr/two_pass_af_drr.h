// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/thread_pool.h"
#include "drr/drr_renderer.h"
#include "drr/field_level.h"
#include "drr/viewpoint_blender.h"

namespace af {

struct TwoPassOptions {
  /// Cubic inserts a node between any two neighbours of the blended image, before it is resampled
  /// bilinearly. The weights are exact for cubics (Lagrange's through six nodes).
  AxisInterpolation st = AxisInterpolation::Linear;
  AxisInterpolation uv = AxisInterpolation::Linear;
  /// Several slabs are summed on a quarter more nodes along each axis, so that the bilinear step
  /// from their sum to pixels loses less. With st = Cubic they always are.
  bool sums_on_more_nodes = false;
};

/// DRRs by look-up in two cheap passes. All rays of a DRR meet in the source, so a ray's (u,v) is
/// an affine function of its (s,t). First the viewpoints around it are blended once per (s,t) node
/// of the detector's footprint. Then that image is resampled to the detector through one
/// homography. In between, the blended images of several slabs are summed on one plane (SlabSum).
/// Differs from the paper: (u,v) weights are taken at the (s,t) nodes instead of at the ray itself.
/// Against ray casting both are equally good. RayByRayAfDrr is the literal quadrilinear look-up,
/// and this class's oracle. Pose derivatives are analytic, from the slopes of both passes. \test
/// TwoPassAfDrr.AgreesWithQuadrilinearLookup
class TwoPassAfDrr final : public DrrRenderer {
 public:
  /// `pool`: threads that share a large DRR; none means the calling thread alone.
  explicit TwoPassAfDrr(std::shared_ptr<const CompressedAttenuationField> field,
                        const TwoPassOptions& options = {},
                        std::shared_ptr<ThreadPool> pool = nullptr);
  /// A level of an image pyramid. It holds the rays that the field holds.
  explicit TwoPassAfDrr(std::shared_ptr<const FieldLevel> level,
                        const TwoPassOptions& options = {},
                        std::shared_ptr<ThreadPool> pool = nullptr);

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;

  /// The gradient image that the paper hints at (Sec. V), without the DRR itself: dU/dcolumn and
  /// dU/drow per pixel (view.pixel_count() values each), for little more than the price of a DRR.
  /// Sobel's weights on the blended (s,t) nodes give the slopes, which are resampled like values.
  /// The result is the gradient of the DRR smoothed over about two nodes. Rays outside are counted
  /// and 0.
  RenderStatus render_gradient_images(const RigidTransform& room_from_ct,
                                      const View& view,
                                      RenderWorkspace& workspace,
                                      std::span<float> column_gradient,
                                      std::span<float> row_gradient) const;

  [[nodiscard]] std::int64_t rays_outside(const RigidTransform& room_from_ct,
                                          const View& view) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return "field"; }

 private:
  TwoPassAfDrr(std::unique_ptr<const ViewpointBlender> blender,
               const TwoPassOptions& options,
               std::shared_ptr<ThreadPool> pool);

  std::unique_ptr<const ViewpointBlender> blender_;
  SlabGeometry sum_slab_;  ///< the lattice on which several slabs are summed
  TwoPassOptions options_;
  std::shared_ptr<ThreadPool> pool_;
};

}  // namespace af
