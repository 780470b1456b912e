// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "drr/drr_renderer.h"

namespace af {

/// DRRs of a CT of which only one part moves, while the rest stays where it was held. They add the
/// part's DRR at a pose and the difference between whole and part at the held pose. At the held
/// pose they are the DRRs of the whole. \test PartMotionDrr.MovesThePartAlone
class PartMotionDrr final : public DrrRenderer {
 public:
  /// Both must have the same CT, frame and blur.
  PartMotionDrr(std::shared_ptr<const DrrRenderer> whole, std::shared_ptr<const DrrRenderer> part);

  /// Holds the rest at a pose, for DRRs of this view alone. Other threads must not render
  /// meanwhile.
  RenderStatus hold(const RigidTransform& room_from_ct, const View& view);

  /// The rest's DRR, row-major over the held view.
  [[nodiscard]] const std::vector<float>& rest() const { return rest_; }

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return part_->name(); }

 private:
  std::shared_ptr<const DrrRenderer> whole_;
  std::shared_ptr<const DrrRenderer> part_;
  std::vector<float> rest_;
};

}  // namespace af
