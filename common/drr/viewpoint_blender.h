// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "drr/blend_kernel.h"
#include "drr/field_level.h"
#include "drr/slab_rays.h"

namespace af {

/// Interpolation along the field's axes: linear between two nodes, or cubic. In (u,v), cubic is
/// Catmull-Rom through four nodes. The field continues linearly beyond its first and last node.
enum class AxisInterpolation { Linear, Cubic };

/// Scratch memory of the first pass; one per thread.
struct BlendScratch {
  std::vector<ViewpointTap> u_taps;  ///< one per s node
  std::vector<ViewpointTap> v_taps;  ///< one per t node
  std::vector<TileTap> u_tiles, v_tiles;
  std::vector<std::int32_t> u_begin, v_begin;
  std::vector<float> u_weights;
};

/// Images of the nodes of a footprint, [t][s]. Rows are `stride` values apart, at least 15 more
/// than there are nodes. The extra values are written, too.
struct BlendedImages {
  float* value = nullptr;
  /// Derivatives with respect to the source's x and z, per mm, as the source moves parallel to the
  /// planes and the nodes stay. Null when not wanted.
  float* source_x = nullptr;
  float* source_z = nullptr;
  std::ptrdiff_t stride = 0;
};

/// First pass of a look-up. All rays of a DRR meet in the source, so the viewpoint (u, v) of a ray
/// is an affine function of its (s, t): u depends on s alone, v on t alone. This blends the
/// viewpoints around every (s,t) node.
class ViewpointBlender {
 public:
  virtual ~ViewpointBlender() = default;

  /// This geometry decides which rays are outside.
  [[nodiscard]] virtual const LightSlab& field_geometry() const = 0;
  /// Slabs to sum over; fewer than the field's where a level has merged them.
  [[nodiscard]] virtual std::size_t slab_count() const = 0;
  /// The (s,t) nodes of slab k.
  [[nodiscard]] virtual const SlabGeometry& slab(std::size_t k) const = 0;
  [[nodiscard]] virtual Footprint footprint(std::size_t k,
                                            const SlabRays& rays,
                                            int margin) const = 0;
  /// Total attenuation of the rays from rays.source through the needed nodes of `footprint`. Nodes
  /// that are not stored are 0. Nodes that are not needed are unspecified.
  virtual void blend(std::size_t k,
                     const SlabRays& rays,
                     const Footprint& footprint,
                     BlendScratch& scratch,
                     const BlendedImages& images) const = 0;
};

/// Blends the codebook's tiles or, where it has a filter, samples.
std::unique_ptr<const ViewpointBlender> make_viewpoint_blender(
    std::shared_ptr<const CompressedAttenuationField> field, AxisInterpolation uv);
/// Blends decoded samples.
std::unique_ptr<const ViewpointBlender> make_viewpoint_blender(
    std::shared_ptr<const FieldLevel> level, AxisInterpolation uv);

}  // namespace af
