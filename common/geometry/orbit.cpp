// SPDX-License-Identifier: Apache-2.0
#include "geometry/orbit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.h"
#include "geometry/motion_range.h"
#include "geometry/rotation_search.h"

namespace af {

namespace {

/// Turns add to an angle of a pose about this axis alone: Rz is the outermost of Rz Ry Rx.
constexpr int kOutermostAxis = 2;

Eigen::Matrix3d turn(const Orbit& orbit, double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, orbit.direction()).toRotationMatrix();
}

struct Angles {
  double low_rad = 0.0;
  double high_rad = 0.0;
};

/// Equidistant angles, both ends included, at most `step_rad` apart.
std::vector<double> angles_within(const Angles& angles, double step_rad) {
  const double width = angles.high_rad - angles.low_rad;
  const int parts = std::max(1, static_cast<int>(std::ceil(width / step_rad)));
  std::vector<double> values;
  for (int i = 0; i <= parts; ++i) values.push_back(angles.low_rad + width * i / parts);
  return values;
}

/// The smallest box that holds the points put into it.
struct PointBox {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());

  void add(const Eigen::Vector3d& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
};

/// Translations of the poses of `range` as seen by cameras that stand `off` from a member. This is
/// the box turned back about the isocentre.
PointBox translations_seen(const Orbit& orbit,
                           const Eigen::Vector3d& from_isocenter_mm,
                           const MotionRange& range,
                           const Angles& off) {
  // Between two angles a point at distance r reaches at most r (1 - cos(step / 2)) farther.
  constexpr double kStepRad = 0.25 * kRadPerDeg;
  PointBox box;
  double farthest_mm = 0.0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d point =
        from_isocenter_mm + corner_pose(range, corner << 3u).translation_mm;
    farthest_mm = std::max(farthest_mm, point.norm());
    for (const double angle : angles_within(off, kStepRad))
      box.add(turn(orbit, -angle) * point - from_isocenter_mm);
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == orbit.axis) continue;
    const double margin_mm = farthest_mm * (1.0 - std::cos(0.5 * kStepRad));
    box.low[axis] -= margin_mm;
    box.high[axis] += margin_mm;
  }
  return box;
}

/// Angles of the poses of `range` as seen by cameras that stand `off` from a member, about an axis
/// whose turns change all three angles. A grid search is enough: an extreme between its nodes
/// exceeds the grid's by far less than the margin.
PointBox rotations_seen(const Orbit& orbit, const MotionRange& range, const Angles& off) {
  constexpr int kParts = 8;
  constexpr double kMargin = 0.01;  // share of the box
  const auto nodes = [&](int axis) {
    const Angles angles{range.low.rotation_rad[axis], range.high.rotation_rad[axis]};
    const double width = angles.high_rad - angles.low_rad;
    return angles_within(angles, std::max(width / kParts, 1e-9));
  };
  const std::vector<double> turns =
      angles_within(off, std::max((off.high_rad - off.low_rad) / kParts, 1e-9));
  PointBox box;
  for (const double rx : nodes(0))
    for (const double ry : nodes(1))
      for (const double rz : nodes(2))
        for (const double angle : turns)
          box.add(angles_from_rotation(turn(orbit, -angle) * rotation_from_angles({rx, ry, rz})));
  const Eigen::Vector3d margin = kMargin * (box.high - box.low);
  box.low -= margin;
  box.high += margin;
  return box;
}

/// Makes 200 degrees ten steps of 20 after any conversion.
constexpr double kRounding = 1e-9;

/// Where members stand.
struct Tiling {
  double first_rad = 0.0;
  double step_rad = 0.0;
  double count = 0.0;  ///< a whole number; unlimited until it is checked
};

/// Fewest equal tiles that hold all angles and are no wider than `most_step_rad`. If the angles
/// hold 0, the nominal camera's angle, a tile is centred there: a seam would cost every pose two
/// look-ups.
Tiling tiling_of(const Angles& angles, double most_step_rad) {
  const double width = angles.high_rad - angles.low_rad;
  if (angles.low_rad > 0.0 || angles.high_rad < 0.0) {
    const double count = std::max(1.0, std::ceil(width / most_step_rad - kRounding));
    return {angles.low_rad + 0.5 * width / count, width / count, count};
  }
  const auto beside = [&](double angle) {
    return std::max(0.0, std::ceil(angle / most_step_rad - 0.5 - kRounding));
  };
  const double below = beside(-angles.low_rad);
  const double above = beside(angles.high_rad);
  const double step = std::max(-angles.low_rad / (below + 0.5), angles.high_rad / (above + 0.5));
  return {-below * step, step, below + 1.0 + above};
}

/// Angle at which a camera's source stands about an orbit's axis, as the CT at the nominal pose
/// sees it.
class SourceAngle {
 public:
  SourceAngle(const CameraGeometry& camera,
              const Eigen::Vector3d& isocenter_point,
              const PoseFrame& frame,
              const Orbit& orbit)
      : source_(camera.source_point - frame.center_room_mm),
        axis_(frame.center_room_mm - isocenter_point) {
    const Eigen::Vector3d from_axis = camera.source_point - isocenter_point;
    const Eigen::Vector3d along = orbit.direction();
    ahead_ = (from_axis - along.dot(from_axis) * along).normalized();
    aside_ = along.cross(ahead_);
  }

  /// Largest sign * (angle from where the camera's own source stands + turn_share * rz) over a box
  /// of poses. Corners are enough for the shifts: sources on one side of a half-plane through the
  /// axis are a convex set.
  [[nodiscard]] double largest(const MotionRange& box, double sign, double turn_share) const {
    return maxima_over_rotations(
               box,
               1,
               [&](const Eigen::Vector3d& angles) {
                 const Eigen::Matrix3d back = rotation_from_angles(angles).transpose();
                 double most = -std::numeric_limits<double>::infinity();
                 for (unsigned corner = 0; corner < 8; ++corner)
                   most = std::max(
                       most,
                       sign * of_source(back *
                                        (source_ - corner_pose(box, corner << 3u).translation_mm)));
                 return most + sign * turn_share * angles[kOutermostAxis];
               },
               [](double most, std::size_t /*i*/) { return most; })
        .front();
  }

  /// Half-space (ct frame) of sources at less than `angle_rad`, over half a turn. With `sign` -1:
  /// at more.
  [[nodiscard]] HalfSpace half_space(double angle_rad, double sign, const PoseFrame& frame) const {
    const Eigen::Vector3d normal =
        sign * (std::cos(angle_rad) * aside_ - std::sin(angle_rad) * ahead_);
    // The plane passes through the axis, which lies at `axis_` before the frame's centre.
    const HalfSpace about_center{normal, -normal.dot(axis_)};
    RigidTransform ct_from_center = RigidTransform::Identity();
    ct_from_center.linear() = frame.rotation.transpose();
    ct_from_center.translation() = frame.center_ct_mm;
    return about_center.in(ct_from_center);
  }

 private:
  /// The angle of a source at this place, given from the frame's centre.
  [[nodiscard]] double of_source(const Eigen::Vector3d& from_center) const {
    const Eigen::Vector3d from_axis = from_center + axis_;
    return std::atan2(aside_.dot(from_axis), ahead_.dot(from_axis));
  }

  Eigen::Vector3d source_;  ///< from the frame's centre
  Eigen::Vector3d axis_;    ///< to the frame's centre from the isocentre
  Eigen::Vector3d ahead_;
  Eigen::Vector3d aside_;
};

/// A box shrunk about its middle.
MotionRange shrunk(const MotionRange& box, double factor) {
  MotionRange part = box;
  const auto shrink = [&](auto& low, auto& high) {
    const Eigen::Vector3d middle = 0.5 * (low + high);
    low = middle + factor * (low - middle);
    high = middle + factor * (high - middle);
  };
  shrink(part.low.rotation_rad, part.high.rotation_rad);
  shrink(part.low.translation_mm, part.high.translation_mm);
  return part;
}

/// What the members of an orbit about the outermost axis are made from.
struct TiledOrbit {
  const Eigen::Vector3d& isocenter_point;
  const PoseFrame& frame;
  const MotionRange& range;
  const Orbit& orbit;
  double half_rad;  ///< half the width of a tile
};

/// Poses that a member is sized for, when a pose's camera and CT turn towards each other by up to
/// `below_rad` and `above_rad` beyond the member's angle.
MotionRange box_within(const TiledOrbit& tiled_orbit, double below_rad, double above_rad) {
  const int axis = tiled_orbit.orbit.axis;
  const PointBox shifts =
      translations_seen(tiled_orbit.orbit,
                        tiled_orbit.frame.center_room_mm - tiled_orbit.isocenter_point,
                        tiled_orbit.range,
                        {tiled_orbit.range.low.rotation_rad[axis] - below_rad,
                         tiled_orbit.range.high.rotation_rad[axis] + above_rad});
  MotionRange box = tiled_orbit.range;
  // The bounds are wider by what rounding may take, so that neighbours touch.
  box.low.rotation_rad[axis] = -above_rad - kRounding;
  box.high.rotation_rad[axis] = below_rad + kRounding;
  box.low.translation_mm = shifts.low;
  box.high.translation_mm = shifts.high;
  return box;
}

/// Poses as seen by cameras that stand `off` from a member, about an axis whose turns change all
/// angles.
MotionRange box_seen(const TiledOrbit& tiled_orbit, const Angles& off) {
  const PointBox shifts =
      translations_seen(tiled_orbit.orbit,
                        tiled_orbit.frame.center_room_mm - tiled_orbit.isocenter_point,
                        tiled_orbit.range,
                        off);
  const PointBox angles = rotations_seen(tiled_orbit.orbit, tiled_orbit.range, off);
  return {{angles.low, shifts.low}, {angles.high, shifts.high}};
}

/// Where the sources of a member end, on both sides of its angle.
struct SourceBounds {
  double reach_rad = 0.0;
  bool has_below = true;
  bool has_above = true;
};

/// Bounds a member by sources. Does nothing where shifts and turns move the sources too far.
void bound_by_sources(const TiledOrbit& tiled_orbit,
                      const SourceBounds& bounds,
                      OrbitMember& member) {
  constexpr double kMostAsideRad = 20.0 * kRadPerDeg;
  constexpr double kMostReachRad = 60.0 * kRadPerDeg;
  constexpr double kLeastHeld = 0.05;  // share of the tile's poses
  if (bounds.reach_rad > kMostReachRad) return;
  const SourceAngle angle(
      member.camera, tiled_orbit.isocenter_point, tiled_orbit.frame, tiled_orbit.orbit);
  const auto box_beyond = [&](double aside_rad) {
    return box_within(tiled_orbit,
                      bounds.has_below ? bounds.reach_rad + aside_rad : tiled_orbit.half_rad,
                      bounds.has_above ? bounds.reach_rad + aside_rad : tiled_orbit.half_rad);
  };
  // Poses put the source farther than their turn about the axis alone would: by this much.
  const MotionRange widest = box_beyond(kMostAsideRad);
  const double aside = std::max(angle.largest(widest, 1.0, 1.0), angle.largest(widest, -1.0, 1.0));
  if (!(aside <= kMostAsideRad)) return;
  const auto is_held = [&](double factor) {
    const MotionRange part = shrunk(member.range, factor);
    return (!bounds.has_above || angle.largest(part, 1.0, 0.0) <= bounds.reach_rad) &&
           (!bounds.has_below || angle.largest(part, -1.0, 0.0) <= bounds.reach_rad);
  };
  if (!is_held(kLeastHeld)) return;
  double held = kLeastHeld;
  double missed = 1.0;
  constexpr int kHalvings = 8;
  for (int i = 0; i < kHalvings; ++i) {
    const double next = 0.5 * (held + missed);
    (is_held(next) ? held : missed) = next;
  }
  member.range = shrunk(member.range, held);
  member.sized_for = box_beyond(aside);
  if (bounds.has_above)
    member.sources.push_back(angle.half_space(bounds.reach_rad, 1.0, tiled_orbit.frame));
  if (bounds.has_below)
    member.sources.push_back(angle.half_space(-bounds.reach_rad, -1.0, tiled_orbit.frame));
}

/// "A_z-80", "A_z7.5".
std::string member_name(const std::string& camera, const Orbit& orbit, double angle_rad) {
  std::ostringstream text;
  text << camera << '_' << "xyz"[orbit.axis] << std::round(angle_rad * kDegPerRad * 100.0) / 100.0;
  return text.str();
}

void require_sound(const Orbit& orbit) {
  const auto refuse = [&](const std::string& why) {
    throw InputError("orbit", text_of(orbit), why);
  };
  constexpr double kWholeTurnRad = 360.0 * kRadPerDeg;
  if (!(std::isfinite(orbit.from_rad) && std::isfinite(orbit.to_rad)) ||
      orbit.to_rad < orbit.from_rad)
    refuse("from and to must be finite and ascending");
  if (orbit.to_rad - orbit.from_rad > kWholeTurnRad || std::abs(orbit.from_rad) > kWholeTurnRad)
    refuse("must be within one turn");
  if (orbit.step_rad && !(*orbit.step_rad > 0.0)) refuse("the step must be positive");
}

}  // namespace

CameraGeometry turned_camera(const CameraGeometry& camera,
                             const Eigen::Vector3d& room_point,
                             const Eigen::Vector3d& direction,
                             double angle_rad) {
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(angle_rad, direction).toRotationMatrix();
  CameraGeometry turned = camera;
  turned.source_point = room_point + rotation * (camera.source_point - room_point);
  turned.detector_origin_point =
      room_point + rotation * (camera.detector_origin_point - room_point);
  turned.column_direction = rotation * camera.column_direction;
  turned.row_direction = rotation * camera.row_direction;
  return turned;
}

double default_step_rad(const Orbit& orbit, const MotionRange& range) {
  constexpr double kLeastRad = 5.0 * kRadPerDeg;
  return std::max(kLeastRad,
                  range.high.rotation_rad[orbit.axis] - range.low.rotation_rad[orbit.axis]);
}

std::vector<OrbitMember> orbit_members(const CameraGeometry& nominal,
                                       const Eigen::Vector3d& isocenter_point,
                                       const PoseFrame& frame,
                                       const MotionRange& range,
                                       const Orbit& orbit) {
  require_sound(orbit);
  const bool adds_up = orbit.axis == kOutermostAxis;
  const double lowest = range.low.rotation_rad[orbit.axis];
  const double highest = range.high.rotation_rad[orbit.axis];
  // Members tile the cameras' angles. About an axis whose turns add up, they tile cameras' angles
  // minus poses' angles.
  const Angles tiled{orbit.from_rad - (adds_up ? highest : 0.0),
                     orbit.to_rad - (adds_up ? lowest : 0.0)};
  const double most_step = orbit.step_rad.value_or(default_step_rad(orbit, range));
  const Tiling tiling = tiling_of(tiled, most_step);
  if (tiling.count > kMaxOrbitMembers)
    throw InputError("orbit",
                     text_of(orbit),
                     "would take " + std::to_string(static_cast<std::int64_t>(tiling.count)) +
                         " fields; at most " + std::to_string(kMaxOrbitMembers) +
                         " stand in a file: take a larger step");
  const TiledOrbit tiled_orbit{isocenter_point, frame, range, orbit, 0.5 * tiling.step_rad};
  const MotionRange of_member =
      adds_up ? box_within(tiled_orbit, tiled_orbit.half_rad, tiled_orbit.half_rad)
              : box_seen(tiled_orbit, {-tiled_orbit.half_rad, tiled_orbit.half_rad});
  std::vector<OrbitMember> members;
  const int count = static_cast<int>(tiling.count);
  for (int i = 0; i < count; ++i) {
    const double angle = tiling.first_rad + i * tiling.step_rad;
    OrbitMember member{turned_camera(nominal, isocenter_point, orbit.direction(), angle),
                       angle,
                       of_member,
                       of_member,
                       {}};
    member.camera.name = member_name(nominal.name, orbit, angle);
    if (adds_up && orbit.members_by == Orbit::MembersBy::Source)
      bound_by_sources(
          tiled_orbit, {tiled_orbit.half_rad + kSeamOverlapRad, i > 0, i + 1 < count}, member);
    members.push_back(std::move(member));
  }
  return members;
}

OrbitMember member_of_sources(const CameraGeometry& nominal,
                              const Eigen::Vector3d& isocenter_point,
                              const PoseFrame& frame,
                              const MotionRange& range,
                              double angle_rad,
                              double reach_rad) {
  const Orbit orbit{kOutermostAxis, angle_rad, angle_rad, {}};
  const TiledOrbit tiled_orbit{isocenter_point, frame, range, orbit, reach_rad};
  const MotionRange box = box_within(tiled_orbit, reach_rad, reach_rad);
  OrbitMember member{turned_camera(nominal, isocenter_point, orbit.direction(), angle_rad),
                     angle_rad,
                     box,
                     box,
                     {}};
  member.camera.name = member_name(nominal.name, orbit, angle_rad);
  bound_by_sources(tiled_orbit, {reach_rad, true, true}, member);
  return member;
}

std::string text_of(const Orbit& orbit) {
  std::ostringstream text;
  text << "axis "
       << "xyz"[orbit.axis] << ", " << orbit.from_rad * kDegPerRad << " to "
       << orbit.to_rad * kDegPerRad << " deg";
  return text.str();
}

}  // namespace af
