// SPDX-License-Identifier: Apache-2.0
#include "register/multi_view_objective.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {
namespace {

/// Value and gradient from the derivative by every pixel.
NormalEquations gradient_equations(const SimilarityMeasure& measure,
                                   std::span<const float> drr,
                                   std::span<const float> planes,
                                   std::span<float> by_pixel,
                                   SimilarityWorkspace& workspace) {
  NormalEquations result;
  result.value = measure.evaluate_with_derivative(drr, by_pixel, workspace);
  const PixelSumKernels kernels = pixel_sum_kernels();
  for (int k = 0; k < 6; ++k)
    result.gradient[k] =
        kernels
            .correlation_sums(planes.data() + static_cast<std::size_t>(k) * drr.size(),
                              by_pixel.data(),
                              nullptr,
                              0.0f,
                              static_cast<std::int32_t>(drr.size()))
            .product;
  return result;
}

}  // namespace

MultiViewObjective::MultiViewObjective(std::vector<ObjectiveView> views)
    : views_(std::move(views)) {
  check(!views_.empty(), "an objective needs at least one view");
  for (const ObjectiveView& view : views_)
    scratch_.push_back({view.renderer->make_workspace(),
                        view.measure->make_workspace(),
                        std::vector<float>(view.view.pixel_count()),
                        {},
                        {}});
}

bool MultiViewObjective::is_in_range(const RigidTransform& room_from_ct) const {
  return std::all_of(views_.begin(), views_.end(), [&](const ObjectiveView& view) {
    return !view.limit.has_value() ||
           view.limit->range.contains(parameters_from_pose(view.limit->frame, room_from_ct));
  });
}

ObjectiveValue MultiViewObjective::evaluate(const RigidTransform& room_from_ct) {
  ObjectiveValue value;
  value.similarity = std::numeric_limits<double>::quiet_NaN();
  if (!is_in_range(room_from_ct)) return value;
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

ObjectiveValue MultiViewObjective::evaluate_with(const RigidTransform& room_from_ct,
                                                 const Eigen::Vector3d& pivot_room_point,
                                                 Derivatives derivatives,
                                                 NormalEquations& result) {
  ObjectiveValue value;
  value.similarity = std::numeric_limits<double>::quiet_NaN();
  result = {};
  if (!is_in_range(room_from_ct)) return value;
  for (std::size_t i = 0; i < views_.size(); ++i) {
    Scratch& scratch = scratch_[i];
    scratch.planes.resize(6 * scratch.drr.size());
    const RenderStatus status =
        views_[i].renderer->render(room_from_ct,
                                   views_[i].view,
                                   *scratch.render,
                                   scratch.drr,
                                   PoseGradients{pivot_room_point, scratch.planes});
    ++value.drr_count;
    if (!status.is_inside()) {
      value.rays_outside = status.rays_outside;
      return value;
    }
    const SimilarityMeasure& measure = *views_[i].measure;
    if (derivatives == Derivatives::NormalEquations) {
      result += measure.normal_equations(scratch.drr, scratch.planes, *scratch.similarity);
    } else {
      scratch.by_pixel.resize(scratch.drr.size());
      result += gradient_equations(
          measure, scratch.drr, scratch.planes, scratch.by_pixel, *scratch.similarity);
    }
  }
  value.similarity = result.value;
  value.is_admissible = true;
  return value;
}

}  // namespace af::registration
