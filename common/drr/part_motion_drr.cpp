// SPDX-License-Identifier: Apache-2.0
#include "drr/part_motion_drr.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "base/error.h"

namespace af {

PartMotionDrr::PartMotionDrr(std::shared_ptr<const DrrRenderer> whole,
                             std::shared_ptr<const DrrRenderer> part)
    : whole_(std::move(whole)), part_(std::move(part)) {}

RenderStatus PartMotionDrr::hold(const RigidTransform& room_from_ct, const View& view) {
  rest_.resize(view.pixel_count());
  const auto workspace = whole_->make_workspace();
  const RenderStatus status = whole_->render(room_from_ct, view, *workspace, rest_);
  std::vector<float> part(rest_.size());
  part_->render(room_from_ct, view, *part_->make_workspace(), part);
  std::transform(rest_.begin(), rest_.end(), part.begin(), rest_.begin(), std::minus<>());
  return status;
}

RenderStatus PartMotionDrr::render(const RigidTransform& room_from_ct,
                                   const View& view,
                                   RenderWorkspace& workspace,
                                   std::span<float> total_attenuation,
                                   const std::optional<PoseGradients>& gradients) const {
  check(rest_.size() == view.pixel_count(), "the rest is held for this view");
  const RenderStatus status =
      part_->render(room_from_ct, view, workspace, total_attenuation, gradients);
  std::transform(total_attenuation.begin(),
                 total_attenuation.end(),
                 rest_.begin(),
                 total_attenuation.begin(),
                 std::plus<>());
  return status;
}

std::unique_ptr<RenderWorkspace> PartMotionDrr::make_workspace() const {
  return part_->make_workspace();
}

}  // namespace af
