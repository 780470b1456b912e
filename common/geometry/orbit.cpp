// SPDX-License-Identifier: Apache-2.0
#include "geometry/orbit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.h"

namespace af {

namespace {

/// The one axis whose turns add to an angle of a pose: Rz is the outermost of Rz Ry Rx.
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

/// The smallest box that points were put into.
struct PointBox {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());

  void add(const Eigen::Vector3d& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
};

/// Translations of the poses of `range` that cameras see which stand `off` from a member: the box
/// turned back about the isocentre.
PointBox translations_seen(const Orbit& orbit,
                           const Eigen::Vector3d& from_isocenter_mm,
                           const MotionRange& range,
                           const Angles& off) {
  // Between two angles a point at the distance r comes at most r (1 - cos(step / 2)) farther.
  constexpr double kStepRad = 0.25 * kRadPerDeg;
  PointBox box;
  double farthest_mm = 0.0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d point = from_isocenter_mm;
    for (int axis = 0; axis < 3; ++axis)
      point[axis] += ((corner >> axis & 1u) != 0 ? range.high : range.low).translation_mm[axis];
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

/// Angles of the poses of `range` that cameras see which stand `off` from a member, about an axis
/// whose turns change all three. Searched on a grid; what an extreme between its nodes can exceed
/// it by is far less than the margin.
PointBox rotations_seen(const Orbit& orbit, const MotionRange& range, const Angles& off) {
  constexpr int kParts = 8;
  constexpr double kMargin = 0.01;  // of the box
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

/// 200 degrees are ten steps of 20 after any conversion.
constexpr double kRounding = 1e-9;

/// Where members stand.
struct Tiling {
  double first_rad = 0.0;
  double step_rad = 0.0;
  double count = 0.0;  ///< whole; of any size, until it is checked
};

/// Fewest equal tiles, no wider than `most_step_rad`, that hold all angles. Where these hold 0, the
/// nominal camera's angle, a tile stands about it: a seam would cost every pose there two look-ups.
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
  // What members tile: angles of cameras, or, where they add up, of cameras less those of poses.
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
  const double half = 0.5 * tiling.step_rad;
  const Angles off = adds_up ? Angles{lowest - half, highest + half} : Angles{-half, half};
  const PointBox shifts =
      translations_seen(orbit, frame.center_room_mm - isocenter_point, range, off);
  MotionRange of_member = range;
  of_member.low.translation_mm = shifts.low;
  of_member.high.translation_mm = shifts.high;
  if (adds_up) {
    // Wider by what rounding may take, so that neighbours touch.
    of_member.low.rotation_rad[orbit.axis] = -half - kRounding;
    of_member.high.rotation_rad[orbit.axis] = half + kRounding;
  } else {
    const PointBox angles = rotations_seen(orbit, range, off);
    of_member.low.rotation_rad = angles.low;
    of_member.high.rotation_rad = angles.high;
  }
  std::vector<OrbitMember> members;
  for (int i = 0; i < static_cast<int>(tiling.count); ++i) {
    const double angle = tiling.first_rad + i * tiling.step_rad;
    OrbitMember member{
        turned_camera(nominal, isocenter_point, orbit.direction(), angle), angle, of_member};
    member.camera.name = member_name(nominal.name, orbit, angle);
    members.push_back(std::move(member));
  }
  return members;
}

std::string text_of(const Orbit& orbit) {
  std::ostringstream text;
  text << "axis "
       << "xyz"[orbit.axis] << ", " << orbit.from_rad * kDegPerRad << " to "
       << orbit.to_rad * kDegPerRad << " deg";
  return text.str();
}

}  // namespace af
