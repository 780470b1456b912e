// SPDX-License-Identifier: Apache-2.0
#include "register/search/searched_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "register/method/prepared_stage.h"
#include "register/problem/target_region.h"

namespace af::registration {
namespace {

/// Smallest coarse pixel, mm on the isocentre plane: registrations find the rest.
constexpr double kLeastPixelMm = 2.0;
/// The lattice and each view's places of it take 20 bytes a translation.
constexpr double kMostTranslations = 4e6;
/// The centre stays at least this share of its distance away from the source.
constexpr double kLeastDepthShare = 0.2;

/// A view's renderer whose blur is the largest below a coarse pixel.
struct CoarseRenderer {
  std::shared_ptr<const DrrRenderer> renderer;
  double blur_sigma_mm = 0.0;
};

CoarseRenderer coarse_renderer(const RegistrationView& view, double pixel_mm) {
  CoarseRenderer chosen{view.renderer, 0.0};
  for (const RendererLevel& level : view.coarse_levels)
    if (level.blur_sigma_mm <= pixel_mm) chosen = {level.renderer, level.blur_sigma_mm};
  return chosen;
}

/// What the lattice's translations do in a view.
struct SeenTranslations {
  std::vector<Eigen::Vector2d> shifts;  ///< of the pattern's first pixel, in coarse pixels
  std::vector<double> depths;           ///< mm along the beam, from the lattice's middle
  Eigen::Vector2i first;                ///< rounded down
  Eigen::Vector2i last;                 ///< beyond the last one
  double nearest = std::numeric_limits<double>::infinity();
  double farthest = -std::numeric_limits<double>::infinity();
};

void require_before_source(const RegistrationView& view,
                           const Eigen::Vector3d& center,
                           const Eigen::Vector3d& translation) {
  const CameraGeometry& camera = view.view.camera;
  if (camera.depth_mm(center + translation) >= kLeastDepthShare * camera.depth_mm(center)) return;
  throw InputError(view_name(view) + "search range",
                   std::to_string(translation.norm()) + " mm",
                   "must not bring the CT to the source");
}

SeenTranslations seen_translations(const RegistrationView& view,
                                   const View& whole,
                                   const SearchedView& searched,
                                   const Eigen::Vector3d& center,
                                   const TranslationLattice& lattice) {
  SeenTranslations seen;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  const Eigen::Vector3d middle = lattice.middle();
  const Eigen::Vector2d in_pattern = searched.pattern.camera.project(center + middle);
  // Sizes follow the depth along the detector's normal.
  const Eigen::Vector3d normal = view.view.camera.beam_direction();
  const double normal_share = normal.dot(searched.along_beam);
  for (std::size_t i = 0; i < lattice.size(); ++i) {
    const Eigen::Vector3d translation = lattice.translation(i);
    require_before_source(view, center, translation);
    seen.shifts.emplace_back(whole.camera.project(center + translation) - in_pattern);
    seen.depths.push_back(normal.dot(translation - middle) / normal_share);
    low = low.cwiseMin(seen.shifts.back());
    high = high.cwiseMax(seen.shifts.back());
    seen.nearest = std::min(seen.nearest, seen.depths.back());
    seen.farthest = std::max(seen.farthest, seen.depths.back());
  }
  seen.first = low.array().floor().cast<int>();
  seen.last = high.array().floor().cast<int>() + 1;
  return seen;
}

/// The middles of layers within which the pattern's border is seen less than a pixel from where the
/// middle shows it.
Steps depth_layers(const SearchedView& searched,
                   const SeenTranslations& seen,
                   double source_distance_mm) {
  const double half_px = 0.5 * std::max(searched.pattern.roi.width, searched.pattern.roi.height);
  const double layer_mm = 2.0 * (source_distance_mm + seen.nearest) / half_px;
  const double range_mm = seen.farthest - seen.nearest;
  const int layers = std::max(1, static_cast<int>(std::ceil(range_mm / layer_mm)));
  const double thickness_mm = range_mm / layers;
  return {seen.nearest + 0.5 * thickness_mm,
          seen.farthest - 0.5 * thickness_mm,
          std::max(thickness_mm, 1e-3)};
}

/// Zeros that the X-ray needs around it, so that the pattern stays within at all shifts.
int border_for(const SeenTranslations& seen, const RegionOfInterest& pattern, const View& whole) {
  return std::max({0,
                   -seen.first.x(),
                   -seen.first.y(),
                   seen.last.x() + pattern.width - whole.roi.width,
                   seen.last.y() + pattern.height - whole.roi.height});
}

std::vector<SearchedView::Place> places_of(const SeenTranslations& seen,
                                           const Steps& depths,
                                           const ShiftWindow& window) {
  std::vector<SearchedView::Place> places;
  for (std::size_t i = 0; i < seen.shifts.size(); ++i) {
    const Eigen::Vector2d at = seen.shifts[i] - seen.first.cast<double>();
    // The last shift has no neighbour: rounding must not make it a corner.
    const Eigen::Vector2d corner =
        at.array().floor().min(Eigen::Array2d(window.columns - 2, window.rows - 2));
    places.push_back(
        {depths.nearest(seen.depths[i]),
         static_cast<std::uint32_t>(corner.y()) * static_cast<std::uint32_t>(window.columns) +
             static_cast<std::uint32_t>(corner.x()),
         static_cast<float>(at.x() - corner.x()),
         static_cast<float>(at.y() - corner.y())});
  }
  return places;
}

}  // namespace

Steps::Steps(double low, double high, double widest)
    : count(std::max(1, 1 + static_cast<int>(std::ceil((high - low) / widest - 1e-9)))) {
  step = count > 1 ? (high - low) / (count - 1) : 0.0;
  first = count > 1 ? low : 0.5 * (low + high);
}

int Steps::nearest(double value) const {
  if (count == 1) return 0;
  return static_cast<int>(std::lround(std::clamp((value - first) / step, 0.0, count - 1.0)));
}

TranslationLattice::TranslationLattice(const MotionRange& range, double step_mm)
    : axes{Steps(range.low.translation_mm.x(), range.high.translation_mm.x(), step_mm),
           Steps(range.low.translation_mm.y(), range.high.translation_mm.y(), step_mm),
           Steps(range.low.translation_mm.z(), range.high.translation_mm.z(), step_mm)} {
  const double count = static_cast<double>(axes[0].count) * axes[1].count * axes[2].count;
  if (count > kMostTranslations)
    throw InputError("search range",
                     range.text(),
                     "must have at most four million translations, a coarse pixel apart");
}

std::size_t TranslationLattice::size() const {
  return static_cast<std::size_t>(axes[0].count) * static_cast<std::size_t>(axes[1].count) *
         static_cast<std::size_t>(axes[2].count);
}

std::array<int, 3> TranslationLattice::node(std::size_t index) const {
  const auto columns = static_cast<std::size_t>(axes[0].count);
  const auto rows = static_cast<std::size_t>(axes[1].count);
  return {static_cast<int>(index % columns),
          static_cast<int>(index / columns % rows),
          static_cast<int>(index / (columns * rows))};
}

Eigen::Vector3d TranslationLattice::translation(std::size_t index) const {
  const std::array<int, 3> at = node(index);
  return {axes[0].at(at[0]), axes[1].at(at[1]), axes[2].at(at[2])};
}

Eigen::Vector3d TranslationLattice::middle() const {
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    const Steps& steps = axes[static_cast<std::size_t>(axis)];
    middle[axis] = 0.5 * (steps.at(0) + steps.at(steps.count - 1));
  }
  return middle;
}

bool TranslationLattice::is_maximum(std::span<const float> values, std::size_t index) const {
  const std::array<int, 3> at = node(index);
  std::size_t stride = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (at[axis] > 0 && values[index - stride] > values[index]) return false;
    if (at[axis] + 1 < axes[axis].count && values[index + stride] > values[index]) return false;
    stride *= static_cast<std::size_t>(axes[axis].count);
  }
  return true;
}

double pixel_mm_of(const RegistrationProblem& problem, int pixels_across) {
  double pixel_mm = kLeastPixelMm;
  for (const RegistrationView& view : problem.views) {
    const RegionOfInterest roi = view.widest_view().roi;
    const double mm =
        std::max(roi.width, roi.height) / view.view.camera.pixels_per_mm(problem.isocenter_point);
    pixel_mm = std::max(pixel_mm, mm / pixels_across);
  }
  return pixel_mm;
}

void SearchedView::add_likeness(std::span<const float> likeness, std::span<float> sums) const {
  const auto below = static_cast<std::size_t>(shift_window.columns);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Place& place = places[i];
    const float* const at =
        likeness.data() + static_cast<std::size_t>(place.layer) * shifts() + place.shift;
    const float upper = at[0] + place.right * (at[1] - at[0]);
    const float lower = at[below] + place.right * (at[below + 1] - at[below]);
    sums[i] += upper + place.below * (lower - upper);
  }
}

namespace {

/// What DRRs show of a view: twice the region, where the target is seen with the centre at the
/// lattice's middle.
View widest_view_at(const RegistrationProblem& problem,
                    const RegistrationView& view,
                    const Eigen::Vector3d& middle) {
  if (middle.isZero(1e-9)) return view.widest_view();
  RigidTransform moved = problem.nominal_room_from_ct;
  moved.pretranslate(middle);
  return View{view.view.camera, region_at(problem, view, moved)}.scaled(kWidestRegionScale);
}

/// Without the gold standard's markers, which no patient has.
const Image2d& searched_mask(const RegistrationView& view) {
  return view.mask_without_markers.pixels.empty() ? view.mask : view.mask_without_markers;
}

}  // namespace

SearchedView searched_view(const RegistrationProblem& problem,
                           const Eigen::Vector3d& center,
                           const RegistrationView& view,
                           const TranslationLattice& lattice,
                           double pixel_mm) {
  const CameraGeometry& camera = view.view.camera;
  const Eigen::Vector3d at_middle = center + lattice.middle();
  const double pixels_per_mm = camera.pixels_per_mm(problem.isocenter_point);
  const int pixel_step = std::max(1, static_cast<int>(std::ceil(pixel_mm * pixels_per_mm - 1e-6)));
  const CoarseRenderer coarse = coarse_renderer(view, pixel_step / pixels_per_mm);
  const StageGrid grid{pixel_step, 1.0, coarse.blur_sigma_mm * pixels_per_mm};
  const View whole = stage_view(View::whole_detector(camera), grid);
  SearchedView searched{stage_view(widest_view_at(problem, view, lattice.middle()), grid),
                        coarse.renderer,
                        {},
                        (at_middle - camera.source_point).normalized(),
                        {0.0, 0.0, 1.0},
                        {},
                        {}};
  const SeenTranslations seen = seen_translations(view, whole, searched, center, lattice);
  searched.depths = depth_layers(searched, seen, (at_middle - camera.source_point).norm());

  const int border = border_for(seen, searched.pattern.roi, whole);
  const SimilarityReference xray =
      stage_reference(view.xray, searched_mask(view), View::whole_detector(camera), grid);
  searched.xray = EdgeImage(xray.xray, xray.used, border);
  if (!(searched.xray.mean_energy() > 0.0))
    throw InputError(view_name(view) + "X-ray", "no edges", "a search needs an image of something");
  searched.shift_window = {seen.first.x() + border,
                           seen.first.y() + border,
                           seen.last.x() - seen.first.x() + 1,
                           seen.last.y() - seen.first.y() + 1};
  searched.places = places_of(seen, searched.depths, searched.shift_window);
  return searched;
}

}  // namespace af::registration
