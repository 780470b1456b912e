// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "ct/ray_caster.h"
#include "drr/drr_renderer.h"
#include "geometry/light_slab.h"

namespace af::evaluation {

/// The planes of a field on which rays are replaced by those through the nodes around them.
enum class InterpolatedPlanes { Uv, St, Both };

/// Ray casting with only the interpolation error of a field's look-up: it has the field's nodes,
/// but neither its codebook nor its 16 bits. It interpolates like TwoPassAfDrr. With (u,v), a ray's
/// value is blended from those of the four viewpoints around it, seen through its own (s,t) point.
/// With (s,t), a pixel's value is bilinear in the image of the nodes, seen from the source. For
/// fields of one slab.
/// \test InterpolatedRayCast.EqualsTheRaysThroughTheNodesAround
class InterpolatedRayCast final : public DrrRenderer {
 public:
  InterpolatedRayCast(std::shared_ptr<const AttenuationVolume> volume,
                      const RayCasterOptions& options,
                      const LightSlab& light_slab,
                      InterpolatedPlanes planes);

  /// The same caster with interpolation on other planes.
  [[nodiscard]] InterpolatedRayCast on(InterpolatedPlanes planes) const;

  /// Does not give gradients.
  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return "interpolated-raycast"; }

 private:
  std::shared_ptr<const AttenuationVolume> volume_;
  RayCaster caster_;
  LightSlab light_slab_;
  InterpolatedPlanes planes_;
};

}  // namespace af::evaluation
