// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>

#include "drr/drr_renderer.h"

namespace af::test {

/// Look-up that ends where rays leave a field: at poses farther than `reach_mm` from one.
class NarrowDrr final : public DrrRenderer {
 public:
  NarrowDrr(std::shared_ptr<const DrrRenderer> renderer,
            const RigidTransform& middle,
            double reach_mm)
      : renderer_(std::move(renderer)), middle_(middle), reach_mm_(reach_mm) {}

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients) const override {
    const double far_mm = (room_from_ct.translation() - middle_.translation()).norm();
    if (far_mm > reach_mm_) return {1};
    return renderer_->render(room_from_ct, view, workspace, total_attenuation, gradients);
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return renderer_->make_workspace();
  }
  [[nodiscard]] const char* name() const override { return "field"; }

 private:
  std::shared_ptr<const DrrRenderer> renderer_;
  RigidTransform middle_;
  double reach_mm_;
};

}  // namespace af::test
