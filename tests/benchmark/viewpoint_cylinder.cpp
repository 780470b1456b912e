// SPDX-License-Identifier: Apache-2.0
#include "benchmark/viewpoint_cylinder.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "geometry/motion_range.h"
#include "geometry/rotation_search.h"

namespace af::benchmark {

namespace {

/// Rays turn by less than the first between source and cylinder. Sources lie less than the second
/// beside where their turns put them.
constexpr double kMostTurnRad = 4.0 * kRadPerDeg;
constexpr double kMostAsideRad = 20.0 * kRadPerDeg;

/// Distances across the axis (mm), which say how far from its source a ray meets the cylinder.
struct AcrossAxis {
  double farthest_pass_mm = 0.0;  ///< of a ray from the axis
  double nearest_source_mm = 0.0;
  double farthest_source_mm = 0.0;
};

/// Bounds over a member's poses. How far a ray passes the axis is linear in the shift, and its sign
/// says on which side. So the corners decide over shifts and detector.
AcrossAxis across_axis(const OrbitScene& scene, const OrbitMember& member) {
  const Eigen::Vector3d center = scene.frame.center_room_mm;
  const auto flat = [](const Eigen::Vector3d& a) { return Eigen::Vector2d(a.x(), a.y()); };
  const Eigen::Vector2d to_axis = flat(scene.isocenter_point - center);
  const Eigen::Vector2d ahead =
      (flat(member.camera.source_point - scene.isocenter_point)).normalized();
  const auto extremes_at = [&](const Eigen::Vector3d& angles) {
    const Eigen::Matrix3d back = rotation_from_angles(angles).transpose();
    AcrossAxis at{0.0, std::numeric_limits<double>::infinity(), 0.0};
    double nearest_ahead = std::numeric_limits<double>::infinity();
    for (unsigned corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d shift = corner_pose(member.sized_for, corner << 3u).translation_mm;
      const Eigen::Vector2d source =
          flat(back * (member.camera.source_point - center - shift)) - to_axis;
      at.farthest_source_mm = std::max(at.farthest_source_mm, source.norm());
      // The distance of a point is at least that along any direction.
      nearest_ahead = std::min(nearest_ahead, ahead.dot(source));
      for (const Eigen::Vector3d& detector : member.camera.detector_corner_points()) {
        const Eigen::Vector2d along =
            flat(back * (detector - member.camera.source_point)).normalized();
        at.farthest_pass_mm = std::max(at.farthest_pass_mm,
                                       std::abs(source.x() * along.y() - source.y() * along.x()));
      }
    }
    at.nearest_source_mm = nearest_ahead;
    return at;
  };
  const std::vector<double> most = maxima_over_rotations(
      member.sized_for, 3, extremes_at, [](const AcrossAxis& at, std::size_t i) {
        return i == 0   ? at.farthest_pass_mm
               : i == 1 ? -at.nearest_source_mm
                        : at.farthest_source_mm;
      });
  return {most[0], -most[1], most[2]};
}

/// The largest change of the angle about the axis along a ray from its source to the cylinder.
double largest_turn(const AcrossAxis& across, double radius_mm) {
  const auto seen_at = [&](double distance_mm) {
    return std::asin(std::min(1.0, across.farthest_pass_mm / distance_mm));
  };
  return std::max(std::abs(seen_at(across.nearest_source_mm) - seen_at(radius_mm)),
                  std::abs(seen_at(across.farthest_source_mm) - seen_at(radius_mm)));
}

OrbitMember member_at(const OrbitScene& scene, double angle_rad, double reach_rad) {
  OrbitMember member = member_of_sources(
      scene.camera, scene.isocenter_point, scene.frame, scene.range, angle_rad, reach_rad);
  if (member.sources.empty())
    throw InputError("orbit", text_of(scene.orbit), "sources move too far aside for columns");
  return member;
}

/// How far sources come beside where their turns put them: by so much the member's box is wider
/// than its reach.
double aside_of(const OrbitMember& member, double reach_rad) {
  return std::max(member.sized_for.high.rotation_rad.z(), -member.sized_for.low.rotation_rad.z()) -
         reach_rad;
}

}  // namespace

LightSlab planes_of(const OrbitScene& scene, const OrbitMember& member) {
  constexpr int kFine = 2048;  // along s and t
  const DepthSlabs slabs = scene.depth_slabs(slab_from_ct_at_nominal(member.camera, scene.frame));
  return make_light_slab(member.camera,
                         scene.frame,
                         member.sized_for,
                         scene.attenuating_corners_ct,
                         {2, kFine, slabs.boundaries_y_mm, slabs.st_plane_y_mm, member.sources});
}

ViewpointCylinder::ViewpointCylinder(const OrbitScene& scene, double step_rad) {
  check(scene.orbit.axis == 2, "an orbit about z");
  const Eigen::Vector3d from_axis = scene.camera.source_point - scene.isocenter_point;
  radius_mm_ = std::hypot(from_axis.x(), from_axis.y());
  RigidTransform room_from_axis = RigidTransform::Identity();
  room_from_axis.linear() =
      Eigen::AngleAxisd(std::atan2(from_axis.y(), from_axis.x()), Eigen::Vector3d::UnitZ())
          .toRotationMatrix();
  room_from_axis.translation() = scene.isocenter_point;
  axis_from_ct_ = room_from_axis.inverse() * scene.frame.nominal_room_from_ct();

  // First the angles that cameras and poses add up to, then how far sources and the last rays come
  // beyond these.
  const double from = scene.orbit.from_rad - scene.range.high.rotation_rad.z();
  const double to = scene.orbit.to_rad - scene.range.low.rotation_rad.z();
  constexpr double kProbeRad = 10.0 * kRadPerDeg;
  const double beyond = kMostAsideRad + kMostTurnRad;
  double aside = 0.0;
  double turn = 0.0;
  for (double angle = from - beyond; angle < to + beyond + kProbeRad; angle += kProbeRad) {
    const OrbitMember member = member_at(scene, angle, 0.5 * kProbeRad);
    aside = std::max(aside, aside_of(member, 0.5 * kProbeRad));
    turn = std::max(turn, largest_turn(across_axis(scene, member), radius_mm_));
  }
  check(turn <= kMostTurnRad, "rays that turn little between source and cylinder");
  const double width = to - from + 2.0 * (aside + turn);
  const int intervals = std::max(1, static_cast<int>(std::ceil(width / step_rad)));
  step_rad_ = width / intervals;
  first_rad_ = from - aside - turn;
  const RigidTransform ct_from_room = scene.frame.nominal_room_from_ct().inverse();
  for (int i = 0; i <= intervals; ++i) {
    const OrbitMember member = member_at(scene, angle_rad(i), step_rad_ + turn);
    columns_.push_back(planes_of(scene, member));
    viewpoint_x_mm_.push_back(
        (columns_.back().slab_from_ct * ct_from_room * member.camera.source_point).x());
  }
}

std::optional<ColumnsOfRay> ViewpointCylinder::columns_of(const Ray& ray_ct) const {
  const Eigen::Vector3d origin = axis_from_ct_ * ray_ct.origin_point;
  const Eigen::Vector3d direction = axis_from_ct_.linear() * ray_ct.direction;
  const Eigen::Vector2d start(origin.x(), origin.y());
  const Eigen::Vector2d along(direction.x(), direction.y());
  // The first solution of |start + x along| = radius, even behind the source.
  const double a = along.squaredNorm();
  const double half_b = start.dot(along);
  const double discriminant = half_b * half_b - a * (start.squaredNorm() - radius_mm_ * radius_mm_);
  if (!(a > 0.0 && discriminant >= 0.0)) return std::nullopt;
  const Eigen::Vector2d hit = start + (-half_b - std::sqrt(discriminant)) / a * along;
  const double place = (std::atan2(hit.y(), hit.x()) - first_rad_) / step_rad_;
  const double last = static_cast<double>(columns_.size()) - 1.0;
  if (!(place >= 0.0 && place <= last)) return std::nullopt;
  const double lower = std::min(std::floor(place), last - 1.0);
  return ColumnsOfRay{static_cast<int>(lower), place - lower};
}

}  // namespace af::benchmark
