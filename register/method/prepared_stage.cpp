// SPDX-License-Identifier: Apache-2.0
#include "register/method/prepared_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <list>
#include <string>
#include <utility>

#include "base/error.h"
#include "register/problem/target_region.h"
#include "xray/gaussian_blur.h"

namespace af::registration {
namespace {

/// Means over blocks of step x step pixels, for the blocks of `part`. The first block has its
/// corner at (first.x, first.y).
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

/// Whether all pixels of each block are used, in a region that whole blocks fill.
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

/// The middle of an extent, filled by a whole number of stage pixels.
Extent whole_pixels(const Extent& extent, int step, int limit) {
  const int whole = std::max(1, extent.count / step) * step;
  if (whole > limit)
    throw InputError("size_px",
                     std::to_string(limit),
                     "the detector must hold a pixel of this stage, " + std::to_string(whole) +
                         " detector pixels wide (pixel_step)");
  // A region narrower than a stage pixel moves inwards at the detector's edge.
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

/// The region grown by half its size to every side, and cut at the detector's edges.
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

/// The value of a pose at which a stage cannot be placed.
constexpr ObjectiveValue kNoValue{.similarity = std::numeric_limits<double>::quiet_NaN()};

/// Markers are hidden only in stages of at least this many pixels, and if three quarters stay
/// visible. In a small region nearly all coarse pixels may touch a marker.
constexpr std::size_t kLeastPixelsToHideIn = 400;

/// The X-ray with the markers hidden, if that leaves enough of it. `visible`: stage pixels without
/// markers; empty: no markers.
SimilarityReference without_markers(SimilarityReference reference,
                                    std::vector<std::uint8_t> visible) {
  const auto used = static_cast<std::size_t>(std::count(visible.begin(), visible.end(), 1));
  const std::size_t pixels = visible.size();
  if (pixels >= kLeastPixelsToHideIn && 4 * used >= 3 * pixels) reference.used = std::move(visible);
  return reference;
}

/// The part of an image's values that lies in a region. Empty when the values are.
std::vector<std::uint8_t> part_of(const std::vector<std::uint8_t>& values,
                                  int width,
                                  const RegionOfInterest& region) {
  std::vector<std::uint8_t> part;
  if (values.empty()) return part;
  for (int row = region.row; row < region.row + region.height; ++row) {
    const auto first = values.begin() + static_cast<std::ptrdiff_t>(row) * width + region.column;
    part.insert(part.end(), first, first + region.width);
  }
  return part;
}

/// The corner of the detector's first whole stage pixel, on the grid of a region's stage pixels.
Eigen::Vector2i first_corner(const RegionOfInterest& region, int step) {
  return {region.column % step, region.row % step};
}

SimilarityOptions similarity_of(const StageOptions& stage) {
  SimilarityOptions similarity = stage.similarity;
  similarity.has_smooth_histogram |=
      known_optimizer(stage.optimizer).needs() == Derivatives::Gradient;
  return similarity;
}

}  // namespace

/// A view as several stages see it. Most stages of a method share their grids.
class SeenView {
 public:
  SeenView(const RegistrationProblem& problem, const RegistrationView& view)
      : view_(view),
        nominal_region_(region_at(problem, view, problem.nominal_room_from_ct)),
        drr_range_(view.drr_range ? *view.drr_range : drr_range_of(problem, view)) {}

  [[nodiscard]] const RegistrationView& view() const { return view_; }

  /// The X-ray of a region as a stage compares it with DRRs. Throws InputError when nothing can be
  /// compared with it.
  SimilarityReference reference(const StageGrid& grid, const RegionOfInterest& region) {
    if (region != nominal_region_) return checked(elsewhere(grid, region));
    for (const auto& [known, reference] : references_)
      if (known == grid) return reference;
    return references_.emplace_back(grid, checked(seen({view_.view.camera, region}, grid))).second;
  }

 private:
  /// The whole detector in the stage pixels of a grid, from which moved regions are cut out.
  struct Detector {
    StageGrid grid;
    Eigen::Vector2i first;  ///< see first_corner()
    SimilarityReference seen;
    std::vector<std::uint8_t> visible;  ///< see without_markers()
  };

  [[nodiscard]] std::vector<std::uint8_t> visible(const RegionOfInterest& region, int step) const {
    const Image2d& mask = view_.mask_without_markers;
    return mask.pixels.empty() ? std::vector<std::uint8_t>() : used_blocks(mask, step, region);
  }

  [[nodiscard]] SimilarityReference seen(const View& view, const StageGrid& grid) const {
    return without_markers(stage_reference(view_.xray, view_.mask, view, grid),
                           visible(scaled_region(view, grid), grid.pixel_step));
  }

  /// Like seen(), but cut out of the whole detector, which is kept, if the stage pixels lie as they
  /// do at the nominal pose. Otherwise the region has been cut at the detector's edge.
  SimilarityReference elsewhere(const StageGrid& grid, const RegionOfInterest& region) {
    const CameraGeometry& camera = view_.view.camera;
    const int step = grid.pixel_step;
    const RegionOfInterest stage_region = scaled_region({camera, region}, grid);
    const Eigen::Vector2i first = first_corner(stage_region, step);
    if (first != first_corner(scaled_region({camera, nominal_region_}, grid), step))
      return seen({camera, region}, grid);
    const Detector& whole = detector(grid, first);
    const RegionOfInterest part = {stage_region.column / step,
                                   stage_region.row / step,
                                   stage_region.width / step,
                                   stage_region.height / step};
    const int width = whole.seen.xray.width;
    SimilarityReference reference;
    reference.xray = crop(whole.seen.xray, part);
    reference.used = part_of(whole.seen.used, width, part);
    return without_markers(std::move(reference), part_of(whole.visible, width, part));
  }

  const Detector& detector(const StageGrid& grid, const Eigen::Vector2i& first) {
    for (const Detector& known : detectors_)
      if (known.grid == grid) return known;
    const int step = grid.pixel_step;
    const CameraGeometry& camera = view_.view.camera;
    const Eigen::Vector2i size_px = (camera.size_px - first) / step * step;
    const RegionOfInterest all = {first.x(), first.y(), size_px.x(), size_px.y()};
    return detectors_.emplace_back(Detector{
        grid,
        first,
        stage_reference(view_.xray, view_.mask, {camera, all}, {step, 1.0, grid.blur_sigma_px}),
        visible(all, step)});
  }

  [[nodiscard]] SimilarityReference checked(SimilarityReference reference) const {
    reference.drr_range = drr_range_;
    std::vector<std::string> found = problems(reference);
    for (std::string& text : found) text.insert(0, view_name(view_));
    throw_if_any(found);
    return reference;
  }

  const RegistrationView& view_;
  RegionOfInterest nominal_region_;
  ValueRange drr_range_;
  std::list<std::pair<StageGrid, SimilarityReference>> references_;  ///< at the nominal pose
  std::list<Detector> detectors_;  ///< made when a region first moves
};

namespace {

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

std::vector<RegionOfInterest> regions_at(const RegistrationProblem& problem,
                                         std::span<const std::shared_ptr<SeenView>> views,
                                         const RigidTransform& room_from_ct,
                                         int step_px) {
  std::vector<RegionOfInterest> regions;
  regions.reserve(views.size());
  for (const std::shared_ptr<SeenView>& seen : views)
    regions.push_back(region_at(problem, seen->view(), room_from_ct, step_px));
  return regions;
}

/// A stage that looks at these regions, not yet narrowed to silhouettes.
PreparedStage stage_over(const RegistrationProblem& problem,
                         const StageOptions& stage,
                         const std::vector<std::shared_ptr<SeenView>>& views,
                         std::vector<RegionOfInterest> regions,
                         const std::shared_ptr<ThreadPool>& pool) {
  std::vector<ObjectiveView> whole;
  std::vector<SilhouetteView> silhouettes;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const RegistrationView& view = views[i]->view();
    const StageGrid grid = stage_grid(problem, view, stage);
    const SimilarityReference reference = views[i]->reference(grid, regions[i]);
    whole.push_back({stage_view({view.view.camera, regions[i]}, grid),
                     stage_renderer(view, stage.level),
                     make_similarity(similarity_of(stage), reference),
                     view.limit});
    if (stage.silhouette_mm > 0.0)
      silhouettes.push_back(silhouette_view(problem, view, whole.back(), reference, stage));
  }
  return {stage,
          &known_optimizer(stage.optimizer),
          views,
          std::move(regions),
          MultiViewObjective(std::move(whole), pool),
          std::move(silhouettes)};
}

}  // namespace

ValueRange drr_range_of(const RegistrationProblem& problem, const RegistrationView& view) {
  const RegionOfInterest region = region_at(problem, view, problem.nominal_room_from_ct);
  const View wide{view.view.camera, grown(region, view.view.camera.size_px)};
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

bool PreparedStage::would_move(const RegistrationProblem& problem,
                               const RigidTransform& room_from_ct) const {
  if (!silhouettes.empty()) return true;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (region_at(problem, views[i]->view(), room_from_ct, options.pixel_step) != regions[i])
      return true;
  return false;
}

bool PreparedStage::place_at(const RegistrationProblem& problem,
                             const RigidTransform& room_from_ct) {
  if (!would_move(problem, room_from_ct)) return true;
  std::vector<RegionOfInterest> there =
      regions_at(problem, views, room_from_ct, options.pixel_step);
  try {
    if (there != regions)
      *this = stage_over(problem, options, views, std::move(there), objective.pool());
  } catch (const InputError&) {  // the X-ray has no contrast there
    return false;
  }
  return narrow_to(problem, room_from_ct);
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
  return place_at(problem, room_from_ct) ? objective.evaluate(room_from_ct) : kNoValue;
}

ObjectiveValue PreparedStage::value_in_place(const RegistrationProblem& problem,
                                             const RigidTransform& room_from_ct) {
  return narrow_to(problem, room_from_ct) ? objective.evaluate(room_from_ct) : kNoValue;
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
  std::vector<std::shared_ptr<SeenView>> seen;
  for (const RegistrationView& view : views)
    seen.push_back(std::make_shared<SeenView>(problem, view));
  std::vector<PreparedStage> prepared;
  for (const StageOptions& stage : stages)
    prepared.push_back(stage_over(
        problem, stage, seen, regions_at(problem, seen, problem.nominal_room_from_ct, 1), threads));
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
