// SPDX-License-Identifier: Apache-2.0
#include "register/method/prepared_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/error.h"
#include "xray/gaussian_blur.h"

namespace af::registration {
namespace {

/// Blocks of step x step pixels, the first one's corner at (column, row).
struct BlockGrid {
  int step;
  int column;
  int row;
};

/// Means (or minima) over blocks.
Image2d block_image(const Image2d& image, const BlockGrid& grid, bool take_minimum) {
  const int step = grid.step;
  Image2d blocks((image.width - grid.column) / step, (image.height - grid.row) / step);
  for (int row = 0; row < blocks.height; ++row)
    for (int column = 0; column < blocks.width; ++column) {
      double sum = 0.0;
      float least = std::numeric_limits<float>::infinity();
      for (int r = 0; r < step; ++r)
        for (int c = 0; c < step; ++c) {
          const float value = image.at(grid.column + column * step + c, grid.row + row * step + r);
          sum += static_cast<double>(value);
          least = std::min(least, value);
        }
      blocks.at(column, row) = take_minimum ? least : static_cast<float>(sum / (step * step));
    }
  return blocks;
}

/// First and count of detector pixels along one axis.
struct Extent {
  int first;
  int count;
};

/// The middle of an extent that a whole number of stage pixels fills.
Extent whole_pixels(const Extent& extent, int step, int limit) {
  const int whole = std::max(1, extent.count / step) * step;
  if (whole > limit)
    throw InputError("size_px",
                     std::to_string(limit),
                     "the detector must hold a pixel of this stage, " + std::to_string(whole) +
                         " detector pixels wide (pixel_step)");
  // A region narrower than a stage pixel, at the detector's edge, moves inwards.
  const int spare = extent.count - whole;
  return {std::min(extent.first + std::max(0, spare) / 2, limit - whole), whole};
}

RegionOfInterest scaled_region(const View& view, const StageGrid& grid) {
  const RegionOfInterest roi = view.scaled(grid.roi_scale).roi;
  const Eigen::Vector2i& size_px = view.camera.size_px;
  const Extent columns = whole_pixels({roi.column, roi.width}, grid.pixel_step, size_px.x());
  const Extent rows = whole_pixels({roi.row, roi.height}, grid.pixel_step, size_px.y());
  return {columns.first, rows.first, columns.count, rows.count};
}

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

/// `drr_ranges`: of the views.
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

}  // namespace

View stage_view(const View& view, const StageGrid& grid) {
  check(grid.pixel_step >= 1, "a stage pixel has at least one detector pixel");
  const View scaled{view.camera, scaled_region(view, grid)};
  return grid.pixel_step == 1 ? scaled : scaled.coarser(grid.pixel_step);
}

SimilarityReference stage_reference(const Image2d& xray,
                                    const Image2d& mask,
                                    const View& view,
                                    const StageGrid& grid) {
  const int step = grid.pixel_step;
  const RegionOfInterest region = scaled_region(view, grid);
  const BlockGrid blocks{step, region.column % step, region.row % step};
  const RegionOfInterest coarse{
      region.column / step, region.row / step, region.width / step, region.height / step};
  // A mean over n pixels blurs by a variance of (n^2 - 1) / 12 along each axis.
  const double missing = grid.blur_sigma_px * grid.blur_sigma_px - (step * step - 1) / 12.0;
  const double sigma = missing > 0.0 ? std::sqrt(missing) / step : 0.0;
  SimilarityReference reference;
  reference.xray =
      crop(gaussian_blur(step == 1 ? xray : block_image(xray, blocks, false), sigma), coarse);
  if (mask.pixels.empty()) return reference;
  Image2d used = mask;
  for (float& value : used.pixels) value = value != 0.0f ? 1.0f : 0.0f;
  used = crop(step == 1 ? used : block_image(used, blocks, true), coarse);
  for (const float value : used.pixels)
    reference.used.push_back(static_cast<std::uint8_t>(value != 0.0f ? 1 : 0));
  return reference;
}

bool PreparedStage::narrow_to(const RegistrationProblem& problem,
                              const RigidTransform& room_from_ct) {
  if (silhouettes.empty()) return true;
  auto narrowed =
      silhouette_objective(silhouettes, problem.cut_points_ct, room_from_ct, objective.pool());
  if (!narrowed.has_value()) return false;
  objective = std::move(*narrowed);
  return true;
}

ObjectiveValue PreparedStage::value_at(const RegistrationProblem& problem,
                                       const RigidTransform& room_from_ct) {
  if (narrow_to(problem, room_from_ct)) return objective.evaluate(room_from_ct);
  ObjectiveValue none;
  none.similarity = std::numeric_limits<double>::quiet_NaN();
  return none;
}

std::vector<PreparedStage> prepared_stages(const RegistrationProblem& problem,
                                           std::span<const StageOptions> stages,
                                           const std::shared_ptr<ThreadPool>& threads) {
  throw_if_any(problems(problem));
  int coarsest = 0;
  for (const StageOptions& stage : stages) coarsest = std::max(coarsest, stage.level);
  for (const RegistrationView& view : problem.views)
    if (static_cast<int>(view.coarse_levels.size()) < coarsest)
      throw InputError(view_name(view) +
                       "coarse_levels = " + std::to_string(view.coarse_levels.size()) +
                       ": the stages need " + std::to_string(coarsest));
  std::vector<ValueRange> drr_ranges;
  for (const RegistrationView& view : problem.views)
    drr_ranges.push_back(drr_range_at_nominal(problem, view));
  std::vector<PreparedStage> prepared;
  for (const StageOptions& stage : stages)
    prepared.push_back(prepared_stage(problem, stage, drr_ranges, threads));
  return prepared;
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
