// SPDX-License-Identifier: Apache-2.0
#include "register/search/searched_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "register/method/prepared_stage.h"
#include "register/problem/silhouette.h"
#include "register/problem/target_region.h"
#include "xray/bilinear.h"

namespace af::registration {
namespace {

/// An edge is so many coarse pixels wide, at most.
constexpr double kEdgePx = 2.0;
/// Smallest coarse pixel, mm on the isocentre plane: registrations find the rest.
constexpr double kLeastPixelMm = 2.0;
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
Steps depth_layers(const SearchedView& searched, const SeenTranslations& seen) {
  const double half_px = 0.5 * std::max(searched.pattern.roi.width, searched.pattern.roi.height);
  const double layer_mm = 2.0 * (searched.distance_mm + seen.nearest) / half_px;
  const double range_mm = seen.farthest - seen.nearest;
  const int layers = std::max(1, static_cast<int>(std::ceil(range_mm / layer_mm)));
  const double thickness_mm = range_mm / layers;
  return {seen.nearest + 0.5 * thickness_mm,
          seen.farthest - 0.5 * thickness_mm,
          std::max(thickness_mm, 1e-3)};
}

/// An image, and which pixels show something (1); empty: all.
struct ScaledImage {
  Image2d image;
  std::vector<std::uint8_t> used;
};

/// Where the pixels of an axis lie in the image before it is enlarged about a point.
std::vector<double> positions_before(double fixed_px, double size, int count) {
  std::vector<double> positions;
  for (int i = 0; i < count; ++i) positions.push_back(fixed_px + (i - fixed_px) / size);
  return positions;
}

/// The image enlarged about a point of it. Beyond its border nothing shows.
ScaledImage scaled_about(const Image2d& image, const Eigen::Vector2d& fixed_px, double size) {
  if (size == 1.0) return {image, {}};
  const std::vector<double> columns = positions_before(fixed_px.x(), size, image.width);
  const std::vector<double> rows = positions_before(fixed_px.y(), size, image.height);
  const auto is_within = [](double position, int count) {
    return position >= -0.5 && position <= count - 0.5;
  };
  std::vector<std::uint8_t> used;
  for (const double row : rows)
    for (const double column : columns)
      used.push_back(is_within(column, image.width) && is_within(row, image.height) ? 1 : 0);
  return {resampled_bilinearly(image, columns, rows), std::move(used)};
}

/// How far the CT's body reaches from the centre of rotations.
double radius_about_center_mm(const RegistrationProblem& problem) {
  double radius_mm = 0.0;
  for (const Eigen::Vector3d& point : problem.attenuating_points_ct.empty()
                                          ? problem.scaling_points_ct
                                          : problem.attenuating_points_ct)
    radius_mm = std::max(radius_mm, (point - problem.center_ct_mm).norm());
  return radius_mm;
}

/// The same pixels as a detector of their own, which may lie beyond that of the camera.
View own_detector(const View& view) {
  CameraGeometry camera = view.camera;
  camera.detector_origin_point = camera.detector_point(view.roi.column, view.roi.row);
  camera.size_px = {view.roi.width, view.roi.height};
  return View::whole_detector(camera);
}

/// Whether DRRs show the whole CT, at any rotation, wherever that lies: without a field, which
/// holds the rays of its detector only.
bool shows_all_of_body(const RegistrationView& view, double silhouette_mm) {
  return silhouette_mm > 0.0 && !view.reach.has_value();
}

/// The square of coarse pixels that shows everything this near to a point of the room.
View square_about(const CameraGeometry& coarse, const Eigen::Vector3d& point, double radius_mm) {
  const Eigen::Vector2i middle = coarse.project(point).array().round().cast<int>();
  const int half = static_cast<int>(std::ceil(radius_mm * coarse.pixels_per_mm(point))) + 1;
  return {coarse, {middle.x() - half, middle.y() - half, 2 * half + 1, 2 * half + 1}};
}

/// Zeros that the X-ray needs around it, so that the pattern stays within at all shifts.
int border_for(const SeenTranslations& seen, const RegionOfInterest& pattern, const View& whole) {
  return std::max({0,
                   -seen.first.x(),
                   -seen.first.y(),
                   seen.last.x() + pattern.width - whole.roi.width,
                   seen.last.y() + pattern.height - whole.roi.height});
}

/// `first`: where the pattern lies in the X-ray at the first shift.
std::vector<SearchedView::Place> places_of(const SeenTranslations& seen,
                                           const Steps& depths,
                                           const Eigen::Vector2i& first) {
  std::vector<SearchedView::Place> places;
  for (std::size_t i = 0; i < seen.shifts.size(); ++i) {
    const Eigen::Vector2d at = seen.shifts[i] - seen.first.cast<double>();
    // Rounding must not make the last shift, which has no neighbour, a corner.
    const Eigen::Vector2i corner =
        at.array().floor().cast<int>().min((seen.last - seen.first).array() - 1);
    places.push_back({depths.nearest(seen.depths[i]),
                      first.x() + corner.x(),
                      first.y() + corner.y(),
                      static_cast<float>(at.x() - corner.x()),
                      static_cast<float>(at.y() - corner.y())});
  }
  return places;
}

}  // namespace

double pixel_mm_of(const RegistrationProblem& problem, int pixels_across, double silhouette_mm) {
  double pixel_mm = kLeastPixelMm;
  for (const RegistrationView& view : problem.views) {
    const CameraGeometry& camera = view.view.camera;
    const RegionOfInterest roi = view.widest_view().roi;
    const double compared_px = shows_all_of_body(view, silhouette_mm)
                                   ? 2.0 * radius_about_center_mm(problem) *
                                         camera.pixels_per_mm(problem.frame().center_room_mm)
                                   : std::max(roi.width, roi.height);
    pixel_mm = std::max(
        pixel_mm, compared_px / camera.pixels_per_mm(problem.isocenter_point) / pixels_across);
  }
  return pixel_mm;
}

SearchedView::Part SearchedView::part(std::span<const std::size_t> nodes) const {
  const Place& any = places[nodes.front()];
  Place low = any;
  Place high = any;
  for (const std::size_t node : nodes) {
    const Place& place = places[node];
    low.depth = std::min(low.depth, place.depth);
    high.depth = std::max(high.depth, place.depth);
    low.column = std::min(low.column, place.column);
    high.column = std::max(high.column, place.column);
    low.row = std::min(low.row, place.row);
    high.row = std::max(high.row, place.row);
  }
  // A place lies between a shift and the next.
  return {{low.column, low.row, high.column - low.column + 2, high.row - low.row + 2},
          low.depth,
          high.depth - low.depth + 1};
}

void SearchedView::compare(const Part& part,
                           const Image2d& drr,
                           std::span<const Eigen::Vector2d> cuts_px,
                           std::span<float> likeness) const {
  const Eigen::Vector2d center_px =
      pattern.camera.project(pattern.camera.source_point + distance_mm * along_beam);
  const std::size_t shifts = part.window.size();
  for (int i = 0; i < part.depths; ++i) {
    const std::span<float> here = likeness.subspan(static_cast<std::size_t>(i) * shifts, shifts);
    const double size = distance_mm / (distance_mm + depths.at(part.first_depth + i));
    const ScaledImage seen = scaled_about(drr, center_px, size);
    const EdgeImage edges(seen.image, seen.used, 0);
    if (silhouette_px == 0.0) {
      correlate(edges, xray, part.window, here);
      continue;
    }
    std::vector<Eigen::Vector2d> cuts(cuts_px.begin(), cuts_px.end());
    for (Eigen::Vector2d& cut : cuts) cut = center_px + size * (cut - center_px);
    const std::vector<std::uint8_t> body = silhouette(seen.image, silhouette_px, cuts);
    if (static_cast<std::size_t>(std::ranges::count(body, std::uint8_t{1})) <
        kLeastSilhouettePixels)
      std::ranges::fill(here, 0.0f);
    else
      correlate_within(body, edges, xray, xray_squares, part.window, here);
  }
}

void SearchedView::add_likeness(const Part& part,
                                std::span<const std::size_t> nodes,
                                std::span<const float> likeness,
                                std::span<float> sums) const {
  const ShiftWindow& window = part.window;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Place& place = places[nodes[i]];
    const float* const at =
        likeness.data() +
        static_cast<std::ptrdiff_t>(place.depth - part.first_depth) *
            static_cast<std::ptrdiff_t>(window.size()) +
        static_cast<std::ptrdiff_t>(place.row - window.first_row) * window.columns +
        (place.column - window.first_column);
    const float upper = at[0] + place.right * (at[1] - at[0]);
    const float* const next = at + window.columns;
    const float lower = next[0] + place.right * (next[1] - next[0]);
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
                           double pixel_mm,
                           double silhouette_mm) {
  const CameraGeometry& camera = view.view.camera;
  const Eigen::Vector3d at_middle = center + lattice.middle();
  const double pixels_per_mm = camera.pixels_per_mm(problem.isocenter_point);
  const int pixel_step = std::max(1, static_cast<int>(std::ceil(pixel_mm * pixels_per_mm - 1e-6)));
  const CoarseRenderer coarse = coarse_renderer(view, pixel_step / pixels_per_mm);
  const StageGrid grid{pixel_step, 1.0, coarse.blur_sigma_mm * pixels_per_mm};
  const View whole = stage_view(View::whole_detector(camera), grid);
  const View pattern = shows_all_of_body(view, silhouette_mm)
                           ? square_about(whole.camera, at_middle, radius_about_center_mm(problem))
                           : stage_view(widest_view_at(problem, view, lattice.middle()), grid);
  SearchedView searched;
  searched.pattern = own_detector(pattern);
  searched.renderer = coarse.renderer;
  searched.along_beam = (at_middle - camera.source_point).normalized();
  searched.distance_mm = (at_middle - camera.source_point).norm();
  if (silhouette_mm > 0.0)
    searched.silhouette_px = std::max(kEdgePx, silhouette_mm * pixels_per_mm / pixel_step);
  const SeenTranslations seen = seen_translations(view, whole, searched, center, lattice);
  searched.depths = depth_layers(searched, seen);

  const int border = border_for(seen, searched.pattern.roi, whole);
  const SimilarityReference xray =
      stage_reference(view.xray, searched_mask(view), View::whole_detector(camera), grid);
  searched.xray = EdgeImage(xray.xray, xray.used, border);
  if (!(searched.xray.mean_energy() > 0.0))
    throw InputError(view_name(view) + "X-ray", "no edges", "a search needs an image of something");
  if (silhouette_mm > 0.0) searched.xray_squares = quarter_squares(searched.xray);
  searched.places =
      places_of(seen, searched.depths, {seen.first.x() + border, seen.first.y() + border});
  return searched;
}

}  // namespace af::registration
