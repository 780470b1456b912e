// SPDX-License-Identifier: Apache-2.0
#include "drr/polychromatic_drr.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace af {

namespace {

class TwoMaterialWorkspace final : public RenderWorkspace {
 public:
  std::unique_ptr<RenderWorkspace> all;
  std::unique_ptr<RenderWorkspace> bone;
  std::vector<float> bone_values;
  std::vector<float> bone_planes;

  void reuse_images(bool is_allowed) override {
    all->reuse_images(is_allowed);
    bone->reuse_images(is_allowed);
  }
};

}  // namespace

PolychromaticDrr::PolychromaticDrr(std::shared_ptr<const DrrRenderer> all,
                                   std::shared_ptr<const DrrRenderer> bone,
                                   std::shared_ptr<const PolychromaticAttenuation> attenuation)
    : all_(std::move(all)), bone_(std::move(bone)), attenuation_(std::move(attenuation)) {}

RenderStatus PolychromaticDrr::render(const RigidTransform& room_from_ct,
                                      const View& view,
                                      RenderWorkspace& workspace,
                                      std::span<float> total_attenuation,
                                      const std::optional<PoseGradients>& gradients) const {
  auto& scratch = dynamic_cast<TwoMaterialWorkspace&>(workspace);
  const std::size_t pixels = total_attenuation.size();
  scratch.bone_values.resize(pixels);
  std::optional<PoseGradients> of_bone = gradients;
  if (of_bone) {
    scratch.bone_planes.resize(gradients->planes.size());
    of_bone->planes = scratch.bone_planes;
  }
  const RenderStatus status =
      all_->render(room_from_ct, view, *scratch.all, total_attenuation, gradients);
  const RenderStatus bone_status =
      bone_->render(room_from_ct, view, *scratch.bone, scratch.bone_values, of_bone);
  if (gradients)
    attenuation_->apply(
        total_attenuation, scratch.bone_values, gradients->planes, scratch.bone_planes);
  else
    attenuation_->apply(total_attenuation, scratch.bone_values);
  return {std::max(status.rays_outside, bone_status.rays_outside)};
}

std::int64_t PolychromaticDrr::rays_outside(const RigidTransform& room_from_ct,
                                            const View& view) const {
  return std::max(all_->rays_outside(room_from_ct, view), bone_->rays_outside(room_from_ct, view));
}

std::unique_ptr<RenderWorkspace> PolychromaticDrr::make_workspace() const {
  auto workspace = std::make_unique<TwoMaterialWorkspace>();
  workspace->all = all_->make_workspace();
  workspace->bone = bone_->make_workspace();
  return workspace;
}

}  // namespace af
