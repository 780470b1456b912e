// SPDX-License-Identifier: Apache-2.0
#include "register/method/prepared_stage.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "register/problem/stage_view.h"

namespace af::registration {
namespace {

/// The region grown by half its size to every side, cut at the detector's edges.
RegionOfInterest grown(const RegionOfInterest& roi, const Eigen::Vector2i& size_px) {
  const int left = std::max(0, roi.column - roi.width / 2);
  const int top = std::max(0, roi.row - roi.height / 2);
  const int right = std::min(size_px.x(), roi.column + roi.width + roi.width / 2);
  const int bottom = std::min(size_px.y(), roi.row + roi.height + roi.height / 2);
  return {left, top, right - left, bottom - top};
}

ValueRange drr_range_at_nominal(const RegistrationProblem& problem, const RegistrationView& view) {
  const View wide{view.view.camera, grown(view.view.roi, view.view.camera.size_px)};
  std::int64_t rays_outside = 0;
  const Image2d drr =
      render_image(*view.renderer, problem.nominal_room_from_ct, wide, &rays_outside);
  if (rays_outside > 0)
    throw InputError(view_name(view) + "nominal_room_from_ct = a pose outside the field (" +
                     RenderStatus{rays_outside}.text(wide) + "): must lie inside the field");
  const auto [low, high] = std::minmax_element(drr.pixels.begin(), drr.pixels.end());
  return {static_cast<double>(*low), static_cast<double>(*high)};
}

StageGrid stage_grid(const RegistrationProblem& problem,
                     const RegistrationView& view,
                     const StageOptions& stage) {
  double variance_mm2 = stage.smoothing_sigma_mm * stage.smoothing_sigma_mm;
  if (stage.level > 0) {
    const auto coarse = static_cast<std::size_t>(stage.level) - 1;
    variance_mm2 += std::pow(view.coarse_levels[coarse].blur_sigma_mm, 2);
  }
  return {stage.pixel_step,
          stage.roi_scale,
          std::sqrt(variance_mm2) * view.view.camera.pixels_per_mm(problem.isocenter_point)};
}

std::shared_ptr<const DrrRenderer> stage_renderer(const RegistrationView& view, int level) {
  return level == 0 ? view.renderer
                    : view.coarse_levels[static_cast<std::size_t>(level) - 1].renderer;
}

/// Markers are hidden only in stages of at least this many pixels, and if three quarters stay
/// visible: in a small region nearly all coarse pixels may touch a marker.
constexpr std::size_t kLeastPixelsToHideIn = 400;

/// The X-ray of a stage with the markers hidden, if that leaves enough of it.
SimilarityReference visible_reference(const RegistrationView& view, const StageGrid& grid) {
  SimilarityReference plain = stage_reference(view.xray, view.mask, view.view, grid);
  if (view.mask_without_markers.pixels.empty()) return plain;
  SimilarityReference hidden =
      stage_reference(view.xray, view.mask_without_markers, view.view, grid);
  const auto used = static_cast<std::size_t>(std::count(hidden.used.begin(), hidden.used.end(), 1));
  const std::size_t pixels = hidden.used.size();
  return pixels >= kLeastPixelsToHideIn && 4 * used >= 3 * pixels ? hidden : plain;
}

/// The X-ray as a stage compares it with DRRs; InputError when nothing can be compared with it.
SimilarityReference prepare_reference(const RegistrationView& view,
                                      const ValueRange& drr_range,
                                      const StageGrid& grid) {
  SimilarityReference reference = visible_reference(view, grid);
  reference.drr_range = drr_range;
  std::vector<std::string> found = problems(reference);
  for (std::string& text : found) text.insert(0, view_name(view));
  throw_if_any(found);
  return reference;
}

SimilarityOptions similarity_of(const StageOptions& stage) {
  SimilarityOptions similarity = stage.similarity;
  similarity.has_smooth_histogram |=
      known_optimizer(stage.optimizer).needs() == Derivatives::Gradient;
  return similarity;
}

ObjectiveView prepare_view(const RegistrationView& view,
                           const SimilarityReference& reference,
                           const StageGrid& grid,
                           const StageOptions& stage) {
  return {stage_view(view.view, grid),
          stage_renderer(view, stage.level),
          make_similarity(similarity_of(stage), reference),
          view.limit};
}

SilhouetteView silhouette_view(const RegistrationProblem& problem,
                               const RegistrationView& view,
                               const ObjectiveView& whole,
                               const SimilarityReference& reference,
                               const StageOptions& stage) {
  const double margin_px = stage.silhouette_mm *
                           view.view.camera.pixels_per_mm(problem.isocenter_point) /
                           stage.pixel_step;
  return {whole, reference, similarity_of(stage), view.renderer, margin_px};
}

}  // namespace

bool PreparedStage::narrow_to(const RegistrationProblem& problem,
                              const RigidTransform& room_from_ct) {
  if (silhouettes.empty()) return true;
  auto narrowed =
      silhouette_objective(silhouettes, problem.cut_points_ct, room_from_ct, objective.pool());
  if (!narrowed.has_value()) return false;
  objective = std::move(*narrowed);
  return true;
}

std::vector<ValueRange> drr_ranges_at_nominal(const RegistrationProblem& problem) {
  std::vector<ValueRange> ranges;
  for (const RegistrationView& view : problem.views)
    ranges.push_back(drr_range_at_nominal(problem, view));
  return ranges;
}

PreparedStage prepared_stage(const RegistrationProblem& problem,
                             const StageOptions& stage,
                             std::span<const ValueRange> drr_ranges,
                             const std::shared_ptr<ThreadPool>& pool) {
  std::vector<ObjectiveView> whole;
  std::vector<SilhouetteView> silhouettes;
  for (std::size_t i = 0; i < problem.views.size(); ++i) {
    const RegistrationView& view = problem.views[i];
    const StageGrid grid = stage_grid(problem, view, stage);
    const SimilarityReference reference = prepare_reference(view, drr_ranges[i], grid);
    whole.push_back(prepare_view(view, reference, grid, stage));
    if (stage.silhouette_mm > 0.0)
      silhouettes.push_back(silhouette_view(problem, view, whole.back(), reference, stage));
  }
  return {stage,
          &known_optimizer(stage.optimizer),
          MultiViewObjective(std::move(whole), pool),
          std::move(silhouettes)};
}

std::shared_ptr<const DrrRenderer> ray_cast_of(const RegistrationView& view, int level) {
  const auto at = static_cast<std::size_t>(level);
  return at < view.ray_casts.size() ? view.ray_casts[at] : nullptr;
}

MultiViewObjective ray_cast_objective(const RegistrationProblem& problem,
                                      const PreparedStage& stage) {
  std::vector<ObjectiveView> views = stage.objective.views();
  for (std::size_t i = 0; i < views.size(); ++i)
    views[i].renderer = ray_cast_of(problem.views[i], stage.options.level);
  return MultiViewObjective(std::move(views), stage.objective.pool());
}

}  // namespace af::registration
