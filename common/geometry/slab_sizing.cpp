// SPDX-License-Identifier: Apache-2.0
#include "geometry/slab_sizing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string_view>

#include "base/error.h"
#include "geometry/hit_extents.h"
#include "geometry/rotation_search.h"

namespace af {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// All translations of a range, as its middle and up to `half_mm` to both sides along each axis.
struct TranslationBox {
  Eigen::Vector3d middle_mm;
  double largest_half_mm = 0.0;
  Eigen::Vector3d share;  ///< share of half_mm along each axis

  explicit TranslationBox(const MotionRange& range)
      : middle_mm(0.5 * (range.low.translation_mm + range.high.translation_mm)),
        share(Eigen::Vector3d::Ones()) {
    const Eigen::Vector3d half = 0.5 * (range.high.translation_mm - range.low.translation_mm);
    largest_half_mm = half.maxCoeff();
    if (largest_half_mm > 0.0) share = half / largest_half_mm;
  }

  /// How much a value that changes by `slope` per mm can grow from the middle on, at most.
  [[nodiscard]] double largest_growth(const Eigen::Vector3d& slope) const {
    return slope.cwiseAbs().cwiseProduct(share).sum() * largest_half_mm;
  }
};

PlaneExtent common_part(const PlaneExtent& a, const PlaneExtent& b) {
  return {std::max(a.x_low_mm, b.x_low_mm),
          std::min(a.x_high_mm, b.x_high_mm),
          std::max(a.z_low_mm, b.z_low_mm),
          std::min(a.z_high_mm, b.z_high_mm)};
}

/// A camera seen from the CT: maps room vectors, for one rotation of the CT, to the slab frame.
class MovingCamera {
 public:
  /// In the slab frame of the camera's own field.
  MovingCamera(const CameraGeometry& camera, const PoseFrame& frame, const MotionRange& range)
      : MovingCamera(camera,
                     frame,
                     range,
                     slab_from_ct_at_nominal(camera, frame).linear(),
                     Eigen::Vector3d::Zero()) {}
  /// In the slab frame of any field.
  MovingCamera(const CameraGeometry& camera,
               const PoseFrame& frame,
               const MotionRange& range,
               const RigidTransform& slab_from_ct)
      : MovingCamera(
            camera, frame, range, slab_from_ct.linear(), slab_from_ct * frame.center_ct_mm) {}
  MovingCamera(const CameraGeometry& camera,
               const PoseFrame& frame,
               const MotionRange& range,
               const Eigen::Matrix3d& slab_from_ct_axes,
               const Eigen::Vector3d& center_in_slab)
      : slab_from_room_(slab_from_ct_axes * frame.rotation.transpose()),
        center_in_slab_(center_in_slab),
        source_from_center_(camera.source_point - frame.center_room_mm),
        range_(range),
        translations_(range) {
    source_from_center_ -= translations_.middle_mm;
    for (std::size_t i = 0; i < corner_directions_.size(); ++i)
      corner_directions_[i] = camera.detector_corner_points()[i] - camera.source_point;
  }

  [[nodiscard]] double nominal_source_y_mm() const {
    return (slab_from_room_ * (source_from_center_ + translations_.middle_mm)).y();
  }

  /// The camera at one rotation of the CT, the translations at their middle.
  struct Turned {
    Eigen::Matrix3d slab_from_room;
    Eigen::Vector3d source;
    std::array<Eigen::Vector3d, 4> corner_directions;
  };
  [[nodiscard]] Turned turned(const Eigen::Vector3d& angles) const {
    Turned at{slab_from_room_ * rotation_from_angles(angles).transpose(), {}, {}};
    at.source = at.slab_from_room * source_from_center_ + center_in_slab_;
    for (std::size_t corner = 0; corner < corner_directions_.size(); ++corner)
      at.corner_directions[corner] = at.slab_from_room * corner_directions_[corner];
    return at;
  }

  /// Charges a source `price` per mm of normal . source - offset beyond a half-space, and credits
  /// one within it.
  struct PricedRegion {
    HalfSpace sources;  ///< slab frame
    double price = 0.0;
  };

  /// Largest coordinate sign * x (axis 0) or sign * z (axis 2), less the price of the source, at
  /// which the ray to detector corner `corner` can meet the plane y = plane_y, over all
  /// translations in range.
  [[nodiscard]] double extreme_hit(const Turned& at,
                                   std::size_t corner,
                                   double plane_y_mm,
                                   int axis,
                                   double sign,
                                   const PricedRegion& region) const {
    const Eigen::Vector3d& direction = at.corner_directions[corner];
    constexpr double kSteepest =
        -0.05;  // rays within 3 degrees of the planes would make them boundless
    if (!(direction.y() < kSteepest * direction.norm()))
      throw InputError("max_rotation_deg",
                       std::to_string(range_.max_rotation_rad() * kDegPerRad),
                       "too large: some rays of the camera run parallel to the field's planes");
    const double slope = direction[axis] / direction.y();
    const double at_rest = at.source[axis] + (plane_y_mm - at.source.y()) * slope;
    const double beyond = region.sources.normal.dot(at.source) - region.sources.offset_mm;
    const Eigen::Vector3d per_source_mm =
        sign * (Eigen::Vector3d::Unit(axis) - slope * Eigen::Vector3d::UnitY()) -
        region.price * region.sources.normal;
    return sign * at_rest - region.price * beyond +
           translations_.largest_growth(at.slab_from_room.transpose() * per_source_mm);
  }

  /// Lowest slab-frame y of the source over the whole motion box.
  [[nodiscard]] double lowest_source_y() const {
    return -maxima_over_rotations(
                range_,
                1,
                [this](const Eigen::Vector3d& angles) { return turned(angles); },
                [this](const Turned& at, std::size_t /*i*/) {
                  return -(at.source.y() -
                           translations_.largest_growth(at.slab_from_room.row(1).transpose()));
                })
                .front();
  }

  /// Where rays to detector corners can meet the planes, over the whole motion box.
  [[nodiscard]] std::vector<PlaneExtent> hits(std::span<const double> plane_y_mm) const {
    return priced_hits(plane_y_mm, [](double /*plane_y*/) { return PricedRegion{}; });
  }

  /// The same for rays whose source is in a half-space (slab frame). Any price of at least 0 gives
  /// a bound (Lagrange's dual): the largest hit less its price, over all sources, bounds the hits
  /// of those within. The least bound over prices is taken. It is nearly tight at the price at
  /// which a source that moves about a point of y = 0 gains nothing.
  [[nodiscard]] std::vector<PlaneExtent> hits_from(const HalfSpace& sources,
                                                   std::span<const double> plane_y_mm) const {
    constexpr std::array kPrices = {0.1, 0.25, 0.45, 0.7, 0.85, 0.95, 1.0, 1.05, 1.15, 1.3};
    std::vector<PlaneExtent> least = hits(plane_y_mm);
    const double aside = std::hypot(sources.normal.x(), sources.normal.z());
    const double away_mm = nominal_source_y_mm();
    if (!(aside > 0.0) || !(away_mm > 0.0)) return least;
    for (const double factor : kPrices) {
      const std::vector<PlaneExtent> bounds = priced_hits(plane_y_mm, [&](double plane_y) {
        return PricedRegion{sources, factor * std::abs(plane_y) / (away_mm * aside)};
      });
      for (std::size_t i = 0; i < least.size(); ++i) least[i] = common_part(least[i], bounds[i]);
    }
    return least;
  }

 private:
  template <typename RegionOf>
  [[nodiscard]] std::vector<PlaneExtent> priced_hits(std::span<const double> plane_y_mm,
                                                     const RegionOf& region_of) const {
    constexpr std::size_t kCorners = 4;
    constexpr std::size_t kSides = 4;  // of a plane: low x, high x, low z, high z
    std::vector<PricedRegion> regions;
    for (const double plane_y : plane_y_mm) regions.push_back(region_of(plane_y));
    const std::vector<double> extremes = maxima_over_rotations(
        range_,
        plane_y_mm.size() * kSides * kCorners,
        [this](const Eigen::Vector3d& angles) { return turned(angles); },
        [&](const Turned& at, std::size_t i) {
          const std::size_t side = i / kCorners % kSides;
          const std::size_t plane = i / (kCorners * kSides);
          return extreme_hit(at,
                             i % kCorners,
                             plane_y_mm[plane],
                             side < 2 ? 0 : 2,
                             side % 2 == 0 ? -1.0 : 1.0,
                             regions[plane]);
        });
    std::vector<PlaneExtent> planes;
    for (auto of_plane = extremes.begin(); of_plane != extremes.end();
         of_plane += kSides * kCorners) {
      const auto largest = [&](std::size_t side) {
        const auto first = of_plane + static_cast<std::ptrdiff_t>(side * kCorners);
        return *std::max_element(first, first + kCorners);
      };
      planes.push_back({-largest(0), largest(1), -largest(2), largest(3)});
    }
    return planes;
  }

  Eigen::Matrix3d slab_from_room_;
  Eigen::Vector3d center_in_slab_;
  Eigen::Vector3d source_from_center_;  ///< at the middle of the translations
  std::array<Eigen::Vector3d, 4> corner_directions_;
  MotionRange range_;
  TranslationBox translations_;
};

/// Vertices of the part of a box (slab frame) with y in [low, high]: the corners inside, and where
/// edges are cut.
std::vector<Eigen::Vector3d> clipped_box(const std::array<Eigen::Vector3d, 8>& corners,
                                         double y_low,
                                         double y_high) {
  std::vector<Eigen::Vector3d> vertices;
  for (const Eigen::Vector3d& corner : corners)
    if (corner.y() >= y_low && corner.y() <= y_high) vertices.push_back(corner);
  for (unsigned a = 0; a < 8; ++a)
    for (unsigned bit = 1; bit < 8; bit <<= 1) {
      const unsigned b = a | bit;
      if (b == a) continue;
      for (const double y : {y_low, y_high}) {
        const double dy_a = corners[a].y() - y;
        const double dy_b = corners[b].y() - y;
        if (dy_a * dy_b < 0.0)
          vertices.push_back(corners[a] + dy_a / (dy_a - dy_b) * (corners[b] - corners[a]));
      }
    }
  return vertices;
}

NodeRange even_aligned_range(const GridAxis& axis, double low_mm, double high_mm) {
  const auto clamp_node = [&](double node) {
    return static_cast<int>(std::clamp(node, 0.0, axis.nodes - 1.0));
  };
  const int first = clamp_node(std::floor(axis.node_coordinate(low_mm)) - 1.0) & ~1;
  const int last = clamp_node(std::ceil(axis.node_coordinate(high_mm)) + 1.0) | 1;
  return {first, std::min(last + 1, axis.nodes) - first};
}

/// Crops a slab to the shadow of `vertices` seen from the (u,v) rectangle's corners. Both maps are
/// projective, so corners decide.
void crop_to_shadow(const LightSlab& light_slab,
                    const std::vector<Eigen::Vector3d>& vertices,
                    SlabGeometry& slab) {
  PlaneExtent shadow{kInfinity, -kInfinity, kInfinity, -kInfinity};
  for (const double u : {light_slab.u.first_mm, light_slab.u.last_mm})
    for (const double v : {light_slab.v.first_mm, light_slab.v.last_mm})
      for (const Eigen::Vector3d& vertex : vertices) {
        const Eigen::Vector3d viewpoint(u, light_slab.uv_plane_y_mm, v);
        const double scale = (slab.st_plane_y_mm - viewpoint.y()) / (vertex.y() - viewpoint.y());
        const Eigen::Vector3d hit = viewpoint + scale * (vertex - viewpoint);
        shadow.x_low_mm = std::min(shadow.x_low_mm, hit.x());
        shadow.x_high_mm = std::max(shadow.x_high_mm, hit.x());
        shadow.z_low_mm = std::min(shadow.z_low_mm, hit.z());
        shadow.z_high_mm = std::max(shadow.z_high_mm, hit.z());
      }
  if (vertices.empty())
    shadow = {slab.s.first_mm, slab.s.first_mm, slab.t.first_mm, slab.t.first_mm};
  slab.stored_s = even_aligned_range(slab.s, shadow.x_low_mm, shadow.x_high_mm);
  slab.stored_t = even_aligned_range(slab.t, shadow.z_low_mm, shadow.z_high_mm);
}

void refuse_source_inside_ct(double highest_ct_y_mm, double lowest_source_y_mm) {
  if (highest_ct_y_mm < lowest_source_y_mm) return;
  std::ostringstream text;
  text << "the X-ray source can come within the CT's depth range: in range it comes as near as "
       << lowest_source_y_mm << " mm to the field's centre plane, and the CT reaches up to "
       << highest_ct_y_mm
       << " mm: reduce max_translation_mm or max_rotation_deg, or correct the rig";
  throw InputError(text.str());
}

std::vector<PlaneExtent> with_margin(std::vector<PlaneExtent> extents) {
  // Rounding and the search's final step stay far below this margin. It also gives a size to a
  // plane that is a single point, when nothing moves.
  for (PlaneExtent& extent : extents) {
    const double margin =
        kExtentMargin *
        std::max({extent.x_high_mm - extent.x_low_mm, extent.z_high_mm - extent.z_low_mm, 1.0});
    extent.x_low_mm -= margin;
    extent.x_high_mm += margin;
    extent.z_low_mm -= margin;
    extent.z_high_mm += margin;
  }
  return extents;
}

void widen(std::vector<PlaneExtent>& extents, const std::vector<PlaneExtent>& others) {
  for (std::size_t i = 0; i < extents.size(); ++i) {
    PlaneExtent& extent = extents[i];
    extent = {std::min(extent.x_low_mm, others[i].x_low_mm),
              std::max(extent.x_high_mm, others[i].x_high_mm),
              std::min(extent.z_low_mm, others[i].z_low_mm),
              std::max(extent.z_high_mm, others[i].z_high_mm)};
  }
}

/// Extents on planes of the rays whose source lies in all of `sources` (ct frame), with a margin.
std::vector<PlaneExtent> extents_from(const CameraGeometry& camera,
                                      const PoseFrame& frame,
                                      const MotionRange& range,
                                      std::span<const double> plane_y_mm,
                                      std::span<const HalfSpace> sources,
                                      const RigidTransform& slab_from_ct) {
  const MovingCamera moving(camera, frame, range);
  if (sources.empty()) return with_margin(moving.hits(plane_y_mm));
  std::vector<PlaneExtent> extents;
  for (const HalfSpace& half_space : sources) {
    const std::vector<PlaneExtent> reached =
        moving.hits_from(half_space.in(slab_from_ct), plane_y_mm);
    if (extents.empty()) extents = reached;
    for (std::size_t i = 0; i < extents.size(); ++i)
      extents[i] = common_part(extents[i], reached[i]);
  }
  // The bounds may have crossed where no source of the range is within. A point is left then.
  for (PlaneExtent& extent : extents) {
    extent.x_high_mm = std::max(extent.x_low_mm, extent.x_high_mm);
    extent.z_high_mm = std::max(extent.z_low_mm, extent.z_high_mm);
  }
  return with_margin(extents);
}

/// The fewest nodes for an axis whose nodes stand no farther apart than those of `other`: an even
/// number, no more than the axis has.
int nodes_at_most_apart(const GridAxis& axis, const GridAxis& other) {
  const int intervals = static_cast<int>(std::ceil(axis.length_mm() / other.spacing_mm()));
  return std::min(axis.nodes, std::max(2, (intervals + 2) / 2 * 2));
}

}  // namespace

HalfSpace HalfSpace::in(const RigidTransform& other_from_own) const {
  const Eigen::Vector3d turned = other_from_own.linear() * normal;
  return {turned, offset_mm + turned.dot(other_from_own.translation())};
}

std::vector<PlaneExtent> extents_on_planes(const CameraGeometry& camera,
                                           const PoseFrame& frame,
                                           const MotionRange& range,
                                           std::span<const double> plane_y_mm) {
  return with_margin(MovingCamera(camera, frame, range).hits(plane_y_mm));
}

std::vector<PlaneExtent> extents_on_planes(const CameraGeometry& camera,
                                           const PoseFrame& frame,
                                           const MotionRange& range,
                                           std::span<const double> plane_y_mm,
                                           const RigidTransform& slab_from_ct) {
  return with_margin(hit_extents(camera, frame, range, plane_y_mm, slab_from_ct));
}

std::vector<PlaneExtent> hit_extents(const CameraGeometry& camera,
                                     const PoseFrame& frame,
                                     const MotionRange& range,
                                     std::span<const double> plane_y_mm,
                                     const RigidTransform& slab_from_ct) {
  return MovingCamera(camera, frame, range, slab_from_ct).hits(plane_y_mm);
}

double lowest_source_y_mm(const CameraGeometry& camera,
                          const PoseFrame& frame,
                          const MotionRange& range,
                          const RigidTransform& slab_from_ct) {
  return MovingCamera(camera, frame, range, slab_from_ct).lowest_source_y();
}

LightSlab make_light_slab(const CameraGeometry& camera,
                          const PoseFrame& frame,
                          const MotionRange& range,
                          const std::array<Eigen::Vector3d, 8>& attenuating_corners_ct,
                          const LightSlabSpec& spec,
                          std::span<const CameraGeometry> more_cameras) {
  check(spec.st_plane_y_mm.size() == spec.slab_boundaries_y_mm.size() + 1,
        "one (s,t) plane per slab");
  LightSlab light_slab;
  light_slab.slab_from_ct = slab_from_ct_at_nominal(camera, frame);
  light_slab.uv_plane_y_mm = MovingCamera(camera, frame, range).nominal_source_y_mm();

  std::array<Eigen::Vector3d, 8> corners = attenuating_corners_ct;
  light_slab.attenuation_end_y_mm = -kInfinity;
  for (Eigen::Vector3d& corner : corners) {
    corner = light_slab.slab_from_ct * corner;
    light_slab.attenuation_end_y_mm = std::max(light_slab.attenuation_end_y_mm, corner.y());
  }
  const auto refuse_inside = [&](const CameraGeometry& moving) {
    refuse_source_inside_ct(light_slab.attenuation_end_y_mm,
                            lowest_source_y_mm(moving, frame, range, light_slab.slab_from_ct));
  };
  refuse_inside(camera);
  for (const CameraGeometry& other : more_cameras) refuse_inside(other);

  std::vector<double> planes = spec.st_plane_y_mm;
  planes.push_back(light_slab.uv_plane_y_mm);
  std::vector<PlaneExtent> extents =
      extents_from(camera, frame, range, planes, spec.sources, light_slab.slab_from_ct);
  for (const CameraGeometry& other : more_cameras)
    widen(extents, extents_on_planes(other, frame, range, planes, light_slab.slab_from_ct));
  light_slab.u = {extents.back().x_low_mm, extents.back().x_high_mm, spec.uv_nodes};
  light_slab.v = {extents.back().z_low_mm, extents.back().z_high_mm, spec.uv_nodes};
  if (!spec.sources.empty()) {
    light_slab.u.nodes = nodes_at_most_apart(light_slab.u, light_slab.v);
    light_slab.v.nodes = nodes_at_most_apart(light_slab.v, light_slab.u);
  }
  for (std::size_t k = 0; k < spec.st_plane_y_mm.size(); ++k) {
    SlabGeometry slab;
    slab.st_plane_y_mm = spec.st_plane_y_mm[k];
    if (k > 0) slab.y_low_mm = spec.slab_boundaries_y_mm[k - 1];
    if (k + 1 < spec.st_plane_y_mm.size()) slab.y_high_mm = spec.slab_boundaries_y_mm[k];
    slab.s = {extents[k].x_low_mm, extents[k].x_high_mm, spec.st_nodes};
    slab.t = {extents[k].z_low_mm, extents[k].z_high_mm, spec.st_nodes};
    crop_to_shadow(light_slab, clipped_box(corners, slab.y_low_mm, slab.y_high_mm), slab);
    light_slab.slabs.push_back(slab);
  }
  return light_slab;
}

}  // namespace af
