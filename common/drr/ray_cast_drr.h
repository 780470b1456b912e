// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "ct/ray_caster.h"
#include "drr/drr_renderer.h"

namespace af {

/// DRRs by the reference ray caster, with its derivatives (RayCaster::cast_with_slopes). No ray is
/// ever outside. \test RayCastDrr.GradientsAgreeWithCentralDifferences
class RayCastDrr final : public DrrRenderer {
 public:
  /// `pool`: threads that share the rows of a DRR; none means the calling thread alone.
  explicit RayCastDrr(std::shared_ptr<const AttenuationVolume> volume,
                      const RayCasterOptions& options = {},
                      std::shared_ptr<ThreadPool> pool = nullptr);

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return "raycast"; }

 private:
  std::shared_ptr<const AttenuationVolume> volume_;
  RayCaster caster_;
  std::shared_ptr<ThreadPool> pool_;
};

/// The fan of rays (ct frame) that a view sees at a pose.
RayFan ray_fan(const RigidTransform& room_from_ct, const View& view);

}  // namespace af
