// SPDX-License-Identifier: Apache-2.0
#include "register/problem/multi_view_objective.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <utility>

#include "base/error.h"
#include "register/similarity/pixel_sums.h"

namespace af::registration {
namespace {

/// A view's measure as the type of what it can do. problems(StageOptions) has checked that before.
template <typename Measure>
const Measure& measure_as(const ObjectiveView& view) {
  return dynamic_cast<const Measure&>(*view.measure);
}

/// Value and gradient from the derivative with respect to every pixel.
NormalEquations gradient_equations(const DifferentiableMeasure& measure,
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

/// The gradient split over tiles of the view's region.
TileScores tile_scores(const RegionOfInterest& roi,
                       int tiles,
                       std::span<const float> planes,
                       std::span<const float> by_pixel) {
  TileScores scores(static_cast<std::size_t>(tiles * tiles), PoseVector::Zero());
  std::size_t pixel = 0;
  for (int row = 0; row < roi.height; ++row)
    for (int column = 0; column < roi.width; ++column, ++pixel) {
      const int tile = row * tiles / roi.height * tiles + column * tiles / roi.width;
      PoseVector& score = scores[static_cast<std::size_t>(tile)];
      const auto weight = static_cast<double>(by_pixel[pixel]);
      for (std::size_t k = 0; k < 6; ++k)
        score[static_cast<Eigen::Index>(k)] +=
            weight * static_cast<double>(planes[k * by_pixel.size() + pixel]);
    }
  return scores;
}

}  // namespace

MultiViewObjective::MultiViewObjective(std::vector<ObjectiveView> views,
                                       std::shared_ptr<ThreadPool> pool)
    : views_(std::move(views)),
      pool_(pool ? std::move(pool) : std::make_shared<ThreadPool>()),
      scratch_(views_.size() * static_cast<std::size_t>(pool_->threads())) {
  check(!views_.empty(), "an objective needs at least one view");
}

ParameterSet MultiViewObjective::beyond_limits(const RigidTransform& room_from_ct) const {
  ParameterSet found;
  for (const ObjectiveView& view : views_)
    if (view.limit.has_value()) found |= view.limit->beyond(room_from_ct);
  return found;
}

RigidTransform MultiViewObjective::nearest_within_limits(const RigidTransform& room_from_ct) const {
  // Rounding must not put it beyond the edge.
  constexpr double kInsideShare = 1.0 - 1e-9;
  RigidTransform nearest = room_from_ct;
  for (const ObjectiveView& view : views_) {
    if (!view.limit.has_value() || view.limit->beyond(nearest).none()) continue;
    const auto& [frame, range] = *view.limit;
    nearest = pose_from_parameters(
        frame, range.clamped(parameters_from_pose(frame, nearest), kInsideShare));
  }
  return nearest;
}

void MultiViewObjective::prepare(std::span<const RigidTransform> room_from_ct) {
  poses_.clear();
  for (const RigidTransform& pose : room_from_ct)
    poses_.push_back({beyond_limits(pose).none(), static_cast<int>(views_.size())});
  if (parts_.size() < poses_.size() * views_.size()) parts_.resize(poses_.size() * views_.size());
}

MultiViewObjective::Scratch& MultiViewObjective::scratch_of(int slot, std::size_t view) {
  Scratch& scratch = scratch_[static_cast<std::size_t>(slot) * views_.size() + view];
  if (!scratch.render) {
    scratch = {views_[view].renderer->make_workspace(),
               views_[view].measure->make_workspace(),
               std::vector<float>(views_[view].view.pixel_count()),
               {},
               {}};
    scratch.render->reuse_images(reuses_images_);
  }
  return scratch;
}

template <typename Compare>
void MultiViewObjective::evaluate_view(std::size_t i,
                                       const RigidTransform& room_from_ct,
                                       std::size_t view,
                                       Scratch& scratch,
                                       const std::optional<PoseGradients>& gradients,
                                       const Compare& compare) {
  std::atomic_ref<int> first_outside(poses_[i].first_outside);
  const int me = static_cast<int>(view);
  if (first_outside < me) return;
  Part& part = parts_[i * views_.size() + view];
  part.rays_outside =
      views_[view]
          .renderer
          ->render(room_from_ct, views_[view].view, *scratch.render, scratch.drr, gradients)
          .rays_outside;
  if (part.rays_outside == 0) {
    compare(part.equations);
    return;
  }
  for (int seen = first_outside; me < seen;)
    if (first_outside.compare_exchange_weak(seen, me)) return;
}

ObjectiveValue MultiViewObjective::sum_of(std::size_t i, NormalEquations& equations) const {
  ObjectiveValue value;
  value.similarity = std::numeric_limits<double>::quiet_NaN();
  equations = {};
  const PoseState& pose = poses_[i];
  if (!pose.is_in_range) return value;
  const auto first_outside = static_cast<std::size_t>(pose.first_outside);
  const Part* const parts = parts_.data() + i * views_.size();
  if (first_outside < views_.size()) {
    value.drr_count = pose.first_outside + 1;
    value.rays_outside = parts[first_outside].rays_outside;
    return value;
  }
  for (std::size_t view = 0; view < views_.size(); ++view) equations += parts[view].equations;
  value.drr_count = static_cast<int>(views_.size());
  value.similarity = equations.value;
  value.is_admissible = true;
  return value;
}

void MultiViewObjective::reuse_images(bool is_allowed) {
  reuses_images_ = is_allowed;
  for (const Scratch& scratch : scratch_)
    if (scratch.render) scratch.render->reuse_images(is_allowed);
}

void MultiViewObjective::forget_images_of_refused(std::size_t i) {
  if (reuses_images_ && poses_[i].first_outside < static_cast<int>(views_.size()))
    reuse_images(true);
}

ObjectiveValue MultiViewObjective::evaluate(const RigidTransform& room_from_ct) {
  ObjectiveValue value;
  evaluate_all({&room_from_ct, 1}, {&value, 1});
  return value;
}

void MultiViewObjective::evaluate_all(std::span<const RigidTransform> room_from_ct,
                                      std::span<ObjectiveValue> values) {
  check(room_from_ct.size() == values.size(), "one value per pose");
  // Which thread takes which pose must not matter.
  if (reuses_images_ && room_from_ct.size() > 1) reuse_images(false);
  prepare(room_from_ct);
  const auto view_count = static_cast<int>(views_.size());
  const auto pose_count = static_cast<int>(room_from_ct.size());
  pool_->for_each(pose_count * view_count, [&](int task, int slot) {
    const auto i = static_cast<std::size_t>(task / view_count);
    const auto view = static_cast<std::size_t>(task % view_count);
    if (!poses_[i].is_in_range) return;
    // Every view of one pose has its own memory, whichever thread takes it.
    Scratch& scratch = scratch_of(pose_count == 1 ? 0 : slot, view);
    evaluate_view(i, room_from_ct[i], view, scratch, std::nullopt, [&](NormalEquations& part) {
      part.value = views_[view].measure->evaluate(scratch.drr, *scratch.similarity);
    });
  });
  NormalEquations equations;
  for (std::size_t i = 0; i < values.size(); ++i) {
    forget_images_of_refused(i);
    values[i] = sum_of(i, equations);
  }
}

ObjectiveValue MultiViewObjective::evaluate_with(const RigidTransform& room_from_ct,
                                                 const Eigen::Vector3d& pivot_room_point,
                                                 Derivatives derivatives,
                                                 NormalEquations& result) {
  prepare({&room_from_ct, 1});
  if (poses_[0].is_in_range)
    pool_->for_each(static_cast<int>(views_.size()), [&](int task, int /*slot*/) {
      const auto view = static_cast<std::size_t>(task);
      Scratch& scratch = scratch_of(0, view);
      scratch.planes.resize(6 * scratch.drr.size());
      const PoseGradients gradients{pivot_room_point, scratch.planes};
      evaluate_view(0, room_from_ct, view, scratch, gradients, [&](NormalEquations& part) {
        if (derivatives == Derivatives::NormalEquations) {
          part = measure_as<LeastSquaresMeasure>(views_[view])
                     .normal_equations(scratch.drr, scratch.planes, *scratch.similarity);
          return;
        }
        scratch.by_pixel.resize(scratch.drr.size());
        part = gradient_equations(measure_as<DifferentiableMeasure>(views_[view]),
                                  scratch.drr,
                                  scratch.planes,
                                  scratch.by_pixel,
                                  *scratch.similarity);
      });
    });
  forget_images_of_refused(0);
  return sum_of(0, result);
}

ObjectiveValue MultiViewObjective::evaluate_scores(const RigidTransform& room_from_ct,
                                                   const Eigen::Vector3d& pivot_room_point,
                                                   int tiles,
                                                   std::vector<TileScores>& scores) {
  check(tiles > 0, "at least one tile");
  prepare({&room_from_ct, 1});
  std::vector<TileScores> found(views_.size());
  if (poses_[0].is_in_range)
    pool_->for_each(static_cast<int>(views_.size()), [&](int task, int /*slot*/) {
      const auto view = static_cast<std::size_t>(task);
      Scratch& scratch = scratch_of(0, view);
      scratch.planes.resize(6 * scratch.drr.size());
      scratch.by_pixel.resize(scratch.drr.size());
      const PoseGradients gradients{pivot_room_point, scratch.planes};
      evaluate_view(0, room_from_ct, view, scratch, gradients, [&](NormalEquations& part) {
        part.value =
            measure_as<DifferentiableMeasure>(views_[view])
                .evaluate_with_derivative(scratch.drr, scratch.by_pixel, *scratch.similarity);
        found[view] = tile_scores(views_[view].view.roi, tiles, scratch.planes, scratch.by_pixel);
      });
    });
  NormalEquations sum;
  const ObjectiveValue value = sum_of(0, sum);
  if (value.is_admissible) scores = std::move(found);
  return value;
}

}  // namespace af::registration
