// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "drr/field_level.h"
#include "drr/slab_rays.h"

namespace af {

/// Where one (s,t) coordinate's rays through the source meet the viewpoints along one axis: between
/// `lower` and lower + 1.
struct ViewpointTap {
  int lower;
  float weight;  ///< of viewpoint lower + 1, in [0, 1]
};

/// Scratch memory of the first pass; one per thread.
struct BlendScratch {
  std::vector<ViewpointTap> u_taps;  ///< one per s node
  std::vector<ViewpointTap> v_taps;  ///< one per t node
  std::vector<float> u_weights;
};

/// First pass of a look-up: all rays of a DRR meet in the source, so the viewpoint (u, v) of a ray
/// is an affine function of its (s, t), u of s and v of t alone. Blends the four viewpoints around
/// it for every (s,t) node.
class ViewpointBlender {
 public:
  virtual ~ViewpointBlender() = default;

  /// Decides which rays are outside.
  [[nodiscard]] virtual const LightSlab& coverage() const = 0;
  /// The (s,t) nodes of slab k, in the order of coverage().slabs.
  [[nodiscard]] virtual const SlabGeometry& lattice(std::size_t k) const = 0;
  /// Total attenuation of the rays from rays.source through the nodes of `footprint`, into
  /// `blended` [t][s]; nodes that are not stored are 0.
  virtual void blend(std::size_t k,
                     const SlabRays& rays,
                     const Footprint& footprint,
                     BlendScratch& scratch,
                     std::span<float> blended) const = 0;
};

/// From the codebook's tiles.
std::unique_ptr<const ViewpointBlender> make_viewpoint_blender(
    std::shared_ptr<const CompressedAttenuationField> field);
/// From decoded samples.
std::unique_ptr<const ViewpointBlender> make_viewpoint_blender(
    std::shared_ptr<const FieldLevel> level);

}  // namespace af
