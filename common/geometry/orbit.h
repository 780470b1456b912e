// SPDX-License-Identifier: Apache-2.0
// Cameras on a C-arm's orbit. A field is made for each, and its motion range is chosen so that
// together the fields hold every pose at every angle.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "geometry/slab_sizing.h"

namespace af {

/// Angles about a room axis through the isocentre, right-handed. The camera turns, not the CT.
struct Orbit {
  int axis = 2;  ///< 0, 1, 2: the room's x, y, z
  double from_rad = 0.0;
  double to_rad = 0.0;
  std::optional<double>
      step_rad;  ///< largest step between two members; without it default_step_rad()
  /// How poses are divided among members. By source: by where the source stands as the CT sees it.
  /// By pose: by the pose's angle, with all shifts in every member. About x and y it is always by
  /// pose.
  enum class MembersBy { Source, Pose } members_by = MembersBy::Source;

  [[nodiscard]] Eigen::Vector3d direction() const { return Eigen::Vector3d::Unit(axis); }
};

/// The camera turned about a room axis through a point.
CameraGeometry turned_camera(const CameraGeometry& camera,
                             const Eigen::Vector3d& room_point,
                             const Eigen::Vector3d& direction,
                             double angle_rad);

/// One field of an atlas: its camera, and what its planes are sized for.
struct OrbitMember {
  CameraGeometry camera;  ///< the nominal one, turned by angle_rad; its name says so
  double angle_rad = 0.0;
  MotionRange range;  ///< about the nominal pose; the member holds all of it
  /// The planes hold those of these poses whose source lies in all of `sources` (ct frame).
  MotionRange sized_for;
  std::vector<HalfSpace> sources;
};

/// How far beyond the seam of two members each still holds what it sees, as an angle about the
/// axis. DRRs thereby pass from one to the other gradually.
inline constexpr double kSeamOverlapRad = 0.75 * kRadPerDeg;

/// The default angle between members: the width of the range about the orbit's axis, at least 5
/// degrees.
double default_step_rad(const Orbit& orbit, const MotionRange& range);

/// Most members of an orbit.
inline constexpr int kMaxOrbitMembers = 64;

/// Members at equal distances, one of them at the nominal camera if the orbit contains it. Together
/// they hold every pose of `range` about the nominal pose of `frame`, seen by the camera at any
/// angle of the orbit.
/// A turn about z, the outermost rotation of a pose, adds to its rz and changes no other angle, so
/// members about z tile the sum of both. Divided by source, a member holds the poses whose source
/// lies between two half-planes through the axis, or up to kSeamOverlapRad beyond, wherever turns
/// and shifts have put it. What shifts need is then held only once.
/// About x and y a member holds the whole range at every angle that is nearest to it. Shifts are
/// along the room's axes, so a member holds the turned box.
/// Throws InputError when there would be more than kMaxOrbitMembers, or when angles are not finite
/// and ascending. \test Orbit.EveryPoseAtEveryAngleIsAMembers
std::vector<OrbitMember> orbit_members(const CameraGeometry& nominal,
                                       const Eigen::Vector3d& isocenter_point,
                                       const PoseFrame& frame,
                                       const MotionRange& range,
                                       const Orbit& orbit);

/// The member of an orbit about z for sources within `reach_rad` of the camera turned by
/// `angle_rad`, as the CT sees them. It holds every pose of `range` at any angle whose source
/// stands there. Where sources move too far for that, it holds all poses of its range, whatever
/// their sources.
/// \test Orbit.AMemberHoldsItsRangeOnPlanesAsNarrowAsItsSources
OrbitMember member_of_sources(const CameraGeometry& nominal,
                              const Eigen::Vector3d& isocenter_point,
                              const PoseFrame& frame,
                              const MotionRange& range,
                              double angle_rad,
                              double reach_rad);

/// "axis z, -90 to 90 deg".
std::string text_of(const Orbit& orbit);

}  // namespace af
