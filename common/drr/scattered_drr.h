// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "drr/drr_renderer.h"

namespace af {

/// DRRs with even scatter. P = exp(-U) is the primary share of the open beam in another renderer's
/// DRR, and s = scatter_to_primary * mean P over the view. Then
///
///     U' = -ln(P + s).
///
/// Scatter spreads over some hundred millimetres on a detector, so within a region of interest most
/// of it is its mean. U' is wrong where scatter is uneven, or where the ratio differs. Derivatives
/// include that of s. \test ScatteredDrr.AddsTheMeanPrimarySignalTimesTheRatio
class ScatteredDrr final : public DrrRenderer {
 public:
  ScatteredDrr(std::shared_ptr<const DrrRenderer> primary, double scatter_to_primary);

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::int64_t rays_outside(const RigidTransform& room_from_ct,
                                          const View& view) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return primary_->name(); }

 private:
  std::shared_ptr<const DrrRenderer> primary_;
  double scatter_to_primary_;
};

}  // namespace af
