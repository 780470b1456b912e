// SPDX-License-Identifier: Apache-2.0
#include "register/method/prepared_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <list>
#include <string>
#include <utility>

#include "base/error.h"
#include "xray/gaussian_blur.h"

namespace af::registration {
namespace {

/// Means over blocks of step x step pixels: of the blocks of `part`, the first one's corner at
/// (first.x, first.y).
Image2d block_means(const Image2d& image,
                    int step,
                    const Eigen::Vector2i& first,
                    const RegionOfInterest& part) {
  Image2d blocks(part.width, part.height);
  std::vector<double> sums(static_cast<std::size_t>(part.width));
  for (int row = 0; row < part.height; ++row) {
    std::fill(sums.begin(), sums.end(), 0.0);
    for (int r = 0; r < step; ++r) {
      const int image_row = first.y() + (part.row + row) * step + r;
      const float* value =
          &image
               .pixels[static_cast<std::size_t>(image_row) * static_cast<std::size_t>(image.width) +
                       static_cast<std::size_t>(first.x() + part.column * step)];
      for (double& sum : sums)
        for (int c = 0; c < step; ++c) sum += static_cast<double>(*value++);
    }
    for (int column = 0; column < part.width; ++column)
      blocks.at(column, row) =
          static_cast<float>(sums[static_cast<std::size_t>(column)] / (step * step));
  }
  return blocks;
}

/// Whether all pixels of each block of a region, which whole blocks fill, are used.
std::vector<std::uint8_t> used_blocks(const Image2d& mask,
                                      int step,
                                      const RegionOfInterest& region) {
  std::vector<std::uint8_t> used(region.pixel_count() / static_cast<std::size_t>(step * step), 1);
  const int columns = region.width / step;
  for (int row = 0; row < region.height; ++row)
    for (int column = 0; column < region.width; ++column)
      if (mask.at(region.column + column, region.row + row) == 0.0f)
        used[static_cast<std::size_t>((row / step) * columns + column / step)] = 0;
  return used;
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
  SimilarityReference reference = stage_reference(view.xray, view.mask, view.view, grid);
  if (view.mask_without_markers.pixels.empty()) return reference;
  std::vector<std::uint8_t> hidden =
      used_blocks(view.mask_without_markers, grid.pixel_step, scaled_region(view.view, grid));
  const auto used = static_cast<std::size_t>(std::count(hidden.begin(), hidden.end(), 1));
  const std::size_t pixels = hidden.size();
  if (pixels >= kLeastPixelsToHideIn && 4 * used >= 3 * pixels) reference.used = std::move(hidden);
  return reference;
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

/// A view as several stages see it: most of a method's stages share their grids.
class SeenView {
 public:
  SeenView(const RegistrationProblem& problem, const RegistrationView& view)
      : view_(view), drr_range_(view.drr_range ? *view.drr_range : drr_range_of(problem, view)) {}

  [[nodiscard]] const RegistrationView& view() const { return view_; }
  const SimilarityReference& reference(const StageGrid& grid) {
    for (const auto& [known, reference] : references_)
      if (known == grid) return reference;
    return references_.emplace_back(grid, prepare_reference(view_, drr_range_, grid)).second;
  }

 private:
  const RegistrationView& view_;
  ValueRange drr_range_;
  std::list<std::pair<StageGrid, SimilarityReference>> references_;
};

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

PreparedStage prepared_stage(const RegistrationProblem& problem,
                             const StageOptions& stage,
                             std::span<SeenView> views,
                             const std::shared_ptr<ThreadPool>& pool) {
  std::vector<ObjectiveView> whole;
  std::vector<SilhouetteView> silhouettes;
  for (SeenView& seen : views) {
    const RegistrationView& view = seen.view();
    const StageGrid grid = stage_grid(problem, view, stage);
    const SimilarityReference& reference = seen.reference(grid);
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

ValueRange drr_range_of(const RegistrationProblem& problem, const RegistrationView& view) {
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
  // Blocks of the whole detector, and those of them that the region and its surroundings take.
  const Eigen::Vector2i first(region.column % step, region.row % step);
  const Eigen::Vector2i blocks((xray.width - first.x()) / step, (xray.height - first.y()) / step);
  const RegionOfInterest coarse{
      region.column / step, region.row / step, region.width / step, region.height / step};
  // A mean over n pixels blurs by a variance of (n^2 - 1) / 12 along each axis.
  const double missing = grid.blur_sigma_px * grid.blur_sigma_px - (step * step - 1) / 12.0;
  const double sigma = missing > 0.0 ? std::sqrt(missing) / step : 0.0;
  const int radius = blur_radius_px(sigma);
  const int left = std::max(0, coarse.column - radius);
  const int top = std::max(0, coarse.row - radius);
  const RegionOfInterest seen{left,
                              top,
                              std::min(blocks.x(), coarse.column + coarse.width + radius) - left,
                              std::min(blocks.y(), coarse.row + coarse.height + radius) - top};
  const Image2d means = step == 1 ? crop(xray, seen) : block_means(xray, step, first, seen);
  SimilarityReference reference;
  reference.xray = crop(gaussian_blur(means, sigma),
                        {coarse.column - left, coarse.row - top, coarse.width, coarse.height});
  if (!mask.pixels.empty()) reference.used = used_blocks(mask, step, region);
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
                                           std::span<const RegistrationView> views,
                                           std::span<const StageOptions> stages,
                                           const std::shared_ptr<ThreadPool>& threads) {
  throw_if_any(problems(problem));
  int coarsest = 0;
  for (const StageOptions& stage : stages) coarsest = std::max(coarsest, stage.level);
  for (const RegistrationView& view : views)
    if (static_cast<int>(view.coarse_levels.size()) < coarsest)
      throw InputError(view_name(view) +
                       "coarse_levels = " + std::to_string(view.coarse_levels.size()) +
                       ": the stages need " + std::to_string(coarsest));
  std::vector<SeenView> seen;
  seen.reserve(views.size());
  for (const RegistrationView& view : views) seen.emplace_back(problem, view);
  std::vector<PreparedStage> prepared;
  for (const StageOptions& stage : stages)
    prepared.push_back(prepared_stage(problem, stage, seen, threads));
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
