// SPDX-License-Identifier: Apache-2.0
#include "register/multi_view_objective.h"

#include <limits>
#include <utility>

#include "base/error.h"

namespace af::registration {
namespace {

bool is_in_range(const ObjectiveView& view, const RigidTransform& room_from_ct) {
  return !view.limit.has_value() ||
         view.limit->range.contains(parameters_from_pose(view.limit->frame, room_from_ct));
}

}  // namespace

MultiViewObjective::MultiViewObjective(std::vector<ObjectiveView> views)
    : views_(std::move(views)) {
  check(!views_.empty(), "an objective needs at least one view");
  for (const ObjectiveView& view : views_)
    scratch_.push_back({view.renderer->make_workspace(),
                        view.measure->make_workspace(),
                        std::vector<float>(view.view.pixel_count())});
}

ObjectiveValue MultiViewObjective::evaluate(const RigidTransform& room_from_ct) {
  ObjectiveValue value;
  value.similarity = std::numeric_limits<double>::quiet_NaN();
  for (const ObjectiveView& view : views_)
    if (!is_in_range(view, room_from_ct)) return value;
  double sum = 0.0;
  for (std::size_t i = 0; i < views_.size(); ++i) {
    Scratch& scratch = scratch_[i];
    const RenderStatus status =
        views_[i].renderer->render(room_from_ct, views_[i].view, *scratch.render, scratch.drr);
    ++value.drr_count;
    if (!status.is_inside()) {
      value.rays_outside = status.rays_outside;
      return value;
    }
    sum += views_[i].measure->evaluate(scratch.drr, *scratch.similarity);
  }
  value.similarity = sum;
  value.is_admissible = true;
  return value;
}

}  // namespace af::registration
