// SPDX-License-Identifier: Apache-2.0
#include "drr/scattered_drr.h"

#include <cmath>
#include <utility>
#include <vector>

namespace af {

namespace {

class PrimaryWorkspace final : public RenderWorkspace {
 public:
  std::unique_ptr<RenderWorkspace> of_primary;
  std::vector<double> primary;

  void reuse_images(bool is_allowed) override { of_primary->reuse_images(is_allowed); }
};

}  // namespace

ScatteredDrr::ScatteredDrr(std::shared_ptr<const DrrRenderer> primary, double scatter_to_primary)
    : primary_(std::move(primary)), scatter_to_primary_(scatter_to_primary) {}

RenderStatus ScatteredDrr::render(const RigidTransform& room_from_ct,
                                  const View& view,
                                  RenderWorkspace& workspace,
                                  std::span<float> total_attenuation,
                                  const std::optional<PoseGradients>& gradients) const {
  auto& scratch = dynamic_cast<PrimaryWorkspace&>(workspace);
  const RenderStatus status =
      primary_->render(room_from_ct, view, *scratch.of_primary, total_attenuation, gradients);
  const std::size_t pixels = total_attenuation.size();
  const double ratio_per_pixel = scatter_to_primary_ / static_cast<double>(pixels);
  scratch.primary.resize(pixels);
  double scatter = 0.0;
  for (std::size_t i = 0; i < pixels; ++i) {
    scratch.primary[i] = std::exp(-static_cast<double>(total_attenuation[i]));
    scatter += ratio_per_pixel * scratch.primary[i];
  }
  if (gradients)
    for (std::size_t k = 0; k < gradients->planes.size(); k += pixels) {
      const std::span<float> plane = gradients->planes.subspan(k, pixels);
      double lost = 0.0;  // scatter, per unit of the parameter
      for (std::size_t i = 0; i < pixels; ++i)
        lost += ratio_per_pixel * scratch.primary[i] * static_cast<double>(plane[i]);
      for (std::size_t i = 0; i < pixels; ++i)
        plane[i] = static_cast<float>((scratch.primary[i] * static_cast<double>(plane[i]) + lost) /
                                      (scratch.primary[i] + scatter));
    }
  for (std::size_t i = 0; i < pixels; ++i)
    total_attenuation[i] = static_cast<float>(-std::log(scratch.primary[i] + scatter));
  return status;
}

std::int64_t ScatteredDrr::rays_outside(const RigidTransform& room_from_ct,
                                        const View& view) const {
  return primary_->rays_outside(room_from_ct, view);
}

std::unique_ptr<RenderWorkspace> ScatteredDrr::make_workspace() const {
  auto workspace = std::make_unique<PrimaryWorkspace>();
  workspace->of_primary = primary_->make_workspace();
  return workspace;
}

}  // namespace af
