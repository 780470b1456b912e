// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "drr/drr_renderer.h"
#include "drr/polychromatic_attenuation.h"

namespace af {

/// DRRs of polychromatic X-rays. One renderer gives the ordinary DRR, another the bone's part of
/// it. PolychromaticAttenuation turns the two, pixel by pixel, into the attenuation of the whole
/// spectrum. The renderers may look up fields or cast rays. Derivatives follow by the chain rule.
/// \test PolychromaticDrr.OfASlabIsTheSumOverTheSpectrum
class PolychromaticDrr final : public DrrRenderer {
 public:
  PolychromaticDrr(std::shared_ptr<const DrrRenderer> all,
                   std::shared_ptr<const DrrRenderer> bone,
                   std::shared_ptr<const PolychromaticAttenuation> attenuation);

  /// Reports the larger rays_outside of the two renderers. Where the ordinary DRR is 0, so is this
  /// one. Where only the bone's ray is outside, the whole ray counts as water.
  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::int64_t rays_outside(const RigidTransform& room_from_ct,
                                          const View& view) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  /// The name of the ordinary DRR's renderer.
  [[nodiscard]] const char* name() const override { return all_->name(); }

 private:
  std::shared_ptr<const DrrRenderer> all_;
  std::shared_ptr<const DrrRenderer> bone_;
  std::shared_ptr<const PolychromaticAttenuation> attenuation_;
};

}  // namespace af
