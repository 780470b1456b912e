// SPDX-License-Identifier: Apache-2.0
#include "geometry/ray_coverage.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/camera_distance.h"
#include "geometry/ct_box.h"
#include "geometry/hit_extents.h"
#include "geometry/motion_range.h"
#include "geometry/orbit.h"
#include "support/c_arm_camera.h"

namespace af {
namespace {

CameraGeometry moved(const CameraGeometry& camera,
                     const Eigen::Vector3d& angles_rad,
                     const Eigen::Vector3d& shift_mm) {
  return test::moved_camera(camera, rotation_from_angles(angles_rad), shift_mm);
}

LightSlab planes_of(const CameraGeometry& camera,
                    const PoseFrame& frame,
                    const MotionRange& range,
                    std::span<const CameraGeometry> more = {},
                    const std::vector<HalfSpace>& sources = {}) {
  LightSlabSpec spec;
  spec.sources = sources;
  spec.slab_boundaries_y_mm = {0.0};
  spec.st_plane_y_mm = {-30.0, 30.0};
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(90.0);
  return make_light_slab(
      camera,
      frame,
      range,
      CtBox{frame.center_ct_mm - half, frame.center_ct_mm + half}.corner_points(),
      spec,
      more);
}

/// Whether the rays of the detector's corners and edges meet all planes at a pose.
bool all_rays_inside(const LightSlab& planes,
                     const CameraGeometry& camera,
                     const PoseFrame& frame,
                     const PoseParameters& parameters) {
  const RigidTransform slab_from_room =
      planes.slab_from_ct * pose_from_parameters(frame, parameters).inverse();
  const Eigen::Vector3d source = slab_from_room * camera.source_point;
  for (const Eigen::Vector3d& corner : camera.detector_corner_points())
    for (const SlabGeometry& slab : planes.slabs)
      if (!planes.intersect({source, slab_from_room * corner - source}, slab)) return false;
  return true;
}

/// Poses of a box: its corners first, then its faces and its interior.
PoseParameters sampled(const MotionRange& range, int index, HashRandom& random) {
  std::array<double, 6> share{};
  for (std::size_t p = 0; p < 6; ++p) {
    share[p] = random.uniform();
    if (index % 2 == 1 && random.uniform() < 0.5) share[p] = share[p] < 0.5 ? 0.0 : 1.0;
    if (index < 64) share[p] = (index >> p & 1) != 0 ? 1.0 : 0.0;
  }
  return pose_at(range, share);
}

TEST(RayCoverage, OfAFieldsOwnCameraIsItsRange) {
  const MotionRange range{8.0 * kRadPerDeg, 25.0};
  const LightSlab planes = planes_of(test::paper_camera(), {}, range);
  EXPECT_TRUE(covers_range(planes, test::paper_camera(), {}, range));
  const MotionRange box = covered_box(planes, test::paper_camera(), {}, range);
  // The planes are larger by kExtentMargin only, and the search stops at its tolerance.
  EXPECT_GE(box.max_rotation_rad(), range.max_rotation_rad());
  EXPECT_LE(box.max_rotation_rad(), range.max_rotation_rad() * (1.0 + kCoveredBoxTolerance));
  EXPECT_EQ(coverage_text("A", 100, 100, box),
            "field covers 100 % of camera A's rays within 8.0 deg / 25.0 mm of nominal");
}

/// One pixel that moves by a tenth of a millimetre: planes of that size hold its rays, however
/// small they are.
TEST(RayCoverage, PlanesNeedNoMarginThatTheRaysDoNot) {
  const MotionRange range{0.0, 0.1};
  CameraGeometry camera = test::paper_camera();
  camera.detector_origin_point = camera.detector_point(127.5, 127.5);
  camera.size_px = {1, 1};
  LightSlab planes = planes_of(camera, {}, range);
  std::vector<double> y_mm = {planes.uv_plane_y_mm};
  for (const SlabGeometry& slab : planes.slabs) y_mm.push_back(slab.st_plane_y_mm);
  const auto hits = hit_extents(camera, {}, range, y_mm, planes.slab_from_ct);
  constexpr double kRoundingMm = 1e-9;
  const auto set = [](const PlaneExtent& hit, GridAxis& x, GridAxis& z) {
    x = {hit.x_low_mm - kRoundingMm, hit.x_high_mm + kRoundingMm, x.nodes};
    z = {hit.z_low_mm - kRoundingMm, hit.z_high_mm + kRoundingMm, z.nodes};
  };
  set(hits[0], planes.u, planes.v);
  for (std::size_t k = 0; k < planes.slabs.size(); ++k)
    set(hits[k + 1], planes.slabs[k].s, planes.slabs[k].t);
  EXPECT_LT(hits[1].x_high_mm - hits[1].x_low_mm, 1.0);
  EXPECT_TRUE(covers_range(planes, camera, {}, range));
  EXPECT_FALSE(covers_range(planes, camera, {}, range.scaled(1.001)));
}

TEST(RayCoverage, SaysWhatSampledRaysSay) {
  const MotionRange range{8.0 * kRadPerDeg, 25.0};
  const CameraGeometry nominal = test::paper_camera();
  const LightSlab planes = planes_of(nominal, {}, range);
  CameraGeometry cropped = nominal;
  cropped.size_px = {100, 120};
  cropped.detector_origin_point = nominal.detector_point(70, 90);
  CameraGeometry finer = nominal;
  finer.pixel_spacing_mm = nominal.pixel_spacing_mm / 2.0;
  finer.size_px = {400, 420};
  CameraGeometry farther = nominal;
  farther.source_point.y() -= 12.0;
  for (const CameraGeometry& camera :
       {moved(nominal, {0.01, -0.012, 0.008}, {3.0, -2.0, 4.0}), cropped, finer, farther}) {
    const MotionRange box = covered_box(planes, camera, {}, range);
    ASSERT_GT(box.max_translation_mm(), 1.0);
    HashRandom random(3);
    for (int i = 0; i < 2000; ++i)
      ASSERT_TRUE(all_rays_inside(planes, camera, {}, sampled(box, i, random))) << "pose " << i;
    // In a box 5 % larger, rays of some corner or face miss. At angles this small, extremes lie
    // near corners.
    bool is_any_outside = false;
    for (int i = 0; i < 2000 && !is_any_outside; ++i)
      is_any_outside = !all_rays_inside(planes, camera, {}, sampled(box.scaled(1.05), i, random));
    EXPECT_TRUE(is_any_outside) << box.text();
  }
}

TEST(RayCoverage, IsNoneForACameraAcross) {
  const MotionRange range{8.0 * kRadPerDeg, 25.0};
  const LightSlab planes = planes_of(test::paper_camera(), {}, range);
  const CameraGeometry across =
      moved(test::paper_camera(), {0.0, 0.0, std::numbers::pi / 2.0}, Eigen::Vector3d::Zero());
  const MotionRange box = covered_box(planes, across, {}, range);
  EXPECT_EQ(box.max_rotation_rad(), 0.0);
  EXPECT_FALSE(covers_range(planes, across, {}, box));
  EXPECT_EQ(coverage_text("B", 0, 8, box),
            "field covers 0.0 % of camera B's rays at the nominal pose");
}

TEST(RayCoverage, RoundsDownInWords) {
  const MotionRange box{6.29 * kRadPerDeg, 18.99};
  EXPECT_EQ(coverage_text("A", 8, 8, box),
            "field covers 100 % of camera A's rays within 6.2 deg / 18.9 mm of nominal");
  EXPECT_EQ(coverage_text("A", 9999, 10000, box),
            "field covers 99.9 % of camera A's rays at the nominal pose");
}

TEST(MotionRange, SaysWhichPosesItHoldsAndWhatTwoNumbersCanSayOfIt) {
  PoseParameters low;
  PoseParameters high;
  low.rotation_rad = {-0.2, -0.1, -0.5};
  high.rotation_rad = {0.3, 0.1, 0.4};
  low.translation_mm = {-10.0, -60.0, -5.0};
  high.translation_mm = {20.0, 40.0, 5.0};
  const MotionRange range(low, high);
  EXPECT_FALSE(range.is_symmetric());
  EXPECT_EQ(range.symmetric_part().max_rotation_rad(), 0.1);
  EXPECT_EQ(range.symmetric_part().max_translation_mm(), 5.0);
  EXPECT_EQ(range.max_rotation_rad(), 0.5);
  EXPECT_TRUE(range.contains(high));
  PoseParameters beyond = high;
  beyond.translation_mm.z() = 5.1;
  EXPECT_FALSE(range.contains(beyond));
  EXPECT_TRUE(range.contains(range.clamped(beyond)));
  EXPECT_TRUE(problems(range).empty());
  std::swap(low.rotation_rad.x(), high.rotation_rad.x());
  EXPECT_EQ(problems(MotionRange(low, high)).size(), 1U);
  // A range that excludes zero covers nothing about zero.
  const MotionRange beside(PoseParameters{Eigen::Vector3d::Constant(0.1), Eigen::Vector3d::Zero()},
                           PoseParameters{Eigen::Vector3d::Constant(0.2), Eigen::Vector3d::Zero()});
  EXPECT_EQ(beside.symmetric_part().max_rotation_rad(), 0.0);
}

TEST(MotionRange, EveryPoseOfRandomRangesIsCoveredForRandomCameras) {
  constexpr int kSettings = 100;
  constexpr int kPosesEach = 100;
  HashRandom random(41);
  const auto anywhere = [&](double size) {
    return Eigen::Vector3d(
        random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size));
  };
  for (int setting = 0; setting < kSettings; ++setting) {
    PoseFrame frame;
    frame.rotation = rotation_from_angles(anywhere(0.6));
    frame.center_ct_mm = anywhere(40.0);
    frame.center_room_mm = anywhere(10.0);
    const CameraGeometry camera = moved(test::paper_camera(), anywhere(3.0), anywhere(10.0));
    // Bounds on either side of zero, or both on the same.
    MotionRange range;
    for (int axis = 0; axis < 3; ++axis) {
      const auto draw = [&](double most, double& low, double& high) {
        const double a = random.uniform(-most, most);
        const double b = random.uniform(-most, most);
        low = std::min(a, b);
        high = std::max(a, b);
      };
      draw(0.25, range.low.rotation_rad[axis], range.high.rotation_rad[axis]);
      draw(60.0, range.low.translation_mm[axis], range.high.translation_mm[axis]);
    }
    const std::array more = {moved(camera, anywhere(0.03), anywhere(15.0))};
    const LightSlab planes = planes_of(camera, frame, range, more);
    for (int i = 0; i < kPosesEach; ++i) {
      const PoseParameters pose = sampled(range, i, random);
      ASSERT_TRUE(all_rays_inside(planes, camera, frame, pose)) << setting << ", " << i;
      ASSERT_TRUE(all_rays_inside(planes, more[0], frame, pose)) << setting << ", " << i;
    }
  }
}

/// An atlas to test: a camera, a range and an orbit, all random.
struct RandomOrbit {
  PoseFrame frame;
  CameraGeometry camera;
  MotionRange range;
  Orbit orbit;
  Eigen::Vector3d isocenter_point;

  explicit RandomOrbit(HashRandom& random) {
    const auto anywhere = [&](double size) {
      return Eigen::Vector3d(
          random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size));
    };
    frame.rotation = rotation_from_angles(anywhere(0.6));
    frame.center_ct_mm = anywhere(40.0);
    frame.center_room_mm = anywhere(20.0);
    isocenter_point = anywhere(20.0);
    camera = moved(test::paper_camera(), anywhere(0.3), anywhere(10.0));
    for (int axis = 0; axis < 3; ++axis) {
      range.low.rotation_rad[axis] = -random.uniform(0.0, 0.2);
      range.high.rotation_rad[axis] = random.uniform(0.0, 0.2);
      range.low.translation_mm[axis] = -random.uniform(0.0, 30.0);
      range.high.translation_mm[axis] = random.uniform(0.0, 30.0);
    }
    orbit.axis = static_cast<int>(random.uniform() * 3.0);
    orbit.from_rad = -random.uniform(0.0, 1.6);
    orbit.to_rad = random.uniform(0.0, 1.6);
    if (random.uniform() < 0.5) orbit.step_rad = random.uniform(0.15, 0.4);
  }

  [[nodiscard]] std::vector<OrbitMember> members() const {
    return orbit_members(camera, isocenter_point, frame, range, orbit);
  }
  [[nodiscard]] CameraGeometry at(double angle_rad) const {
    return turned_camera(camera, isocenter_point, orbit.direction(), angle_rad);
  }
  /// Angles at both ends of the orbit and anywhere between.
  double angle(int index, HashRandom& random) const {
    if (index % 5 == 0) return orbit.from_rad;
    if (index % 5 == 1) return orbit.to_rad;
    return random.uniform(orbit.from_rad, orbit.to_rad);
  }
};

/// The pose that looks to the member's camera as `pose` looks to a camera at `angle_rad`.
PoseParameters seen_by(const OrbitMember& member,
                       const RandomOrbit& atlas,
                       double angle_rad,
                       const RigidTransform& pose) {
  const Eigen::Matrix3d back =
      Eigen::AngleAxisd(member.angle_rad - angle_rad, atlas.orbit.direction()).toRotationMatrix();
  RigidTransform seen = RigidTransform::Identity();
  seen.linear() = back * pose.linear();
  seen.translation() = atlas.isocenter_point + back * (pose.translation() - atlas.isocenter_point);
  return parameters_from_pose(atlas.frame, seen);
}

bool has_source(const OrbitMember& member, const Eigen::Vector3d& source_ct) {
  return std::all_of(member.sources.begin(), member.sources.end(), [&](const HalfSpace& half) {
    return half.contains(source_ct);
  });
}

TEST(Orbit, EveryPoseAtEveryAngleIsAMembers) {
  constexpr int kSettings = 100;
  constexpr int kPosesEach = 300;
  HashRandom random(43);
  int bounded = 0;
  for (int setting = 0; setting < kSettings; ++setting) {
    const RandomOrbit atlas(random);
    const std::vector<OrbitMember> members = atlas.members();
    bounded += members.front().sources.empty() ? 0 : 1;
    for (int i = 0; i < kPosesEach; ++i) {
      const double angle = atlas.angle(i, random);
      const RigidTransform pose =
          pose_from_parameters(atlas.frame, sampled(atlas.range, i, random));
      const Eigen::Vector3d source_ct = pose.inverse() * atlas.at(angle).source_point;
      const bool is_held =
          std::any_of(members.begin(), members.end(), [&](const OrbitMember& member) {
            return has_source(member, source_ct) &&
                   member.sized_for.contains(seen_by(member, atlas, angle, pose));
          });
      ASSERT_TRUE(is_held) << setting << ", pose " << i << ", " << text_of(atlas.orbit)
                           << ", angle " << angle << ", " << atlas.range.text();
    }
  }
  EXPECT_GT(bounded, kSettings / 5);  // a third of them are about z
}

TEST(Orbit, EveryRayAtEveryAngleIsHeldByOneMember) {
  constexpr int kSettings = 50;
  constexpr int kPosesEach = 400;
  HashRandom random(47);
  for (int setting = 0; setting < kSettings; ++setting) {
    const RandomOrbit atlas(random);
    std::vector<LightSlab> planes;
    for (const OrbitMember& member : atlas.members())
      planes.push_back(planes_of(member.camera, atlas.frame, member.sized_for, {}, member.sources));
    for (int i = 0; i < kPosesEach; ++i) {
      const CameraGeometry camera = atlas.at(atlas.angle(i, random));
      const PoseParameters pose = sampled(atlas.range, i, random);
      ASSERT_TRUE(std::any_of(planes.begin(),
                              planes.end(),
                              [&](const LightSlab& of_member) {
                                return all_rays_inside(of_member, camera, atlas.frame, pose);
                              }))
          << setting << ", " << i;
    }
  }
}

/// The width along u over which sampled rays from the member's sources meet the (u,v) plane.
double hit_width(const LightSlab& planes, const OrbitMember& member, HashRandom& random) {
  constexpr int kPoses = 30000;
  double low = 0.0;
  double high = 0.0;
  for (int i = 0; i < kPoses; ++i) {
    const RigidTransform pose =
        pose_from_parameters({}, sampled(member.sized_for, 2 * i + 1, random));
    const Eigen::Vector3d source_ct = pose.inverse() * member.camera.source_point;
    if (!has_source(member, source_ct)) continue;
    const Eigen::Vector3d source = planes.slab_from_ct * source_ct;
    for (const Eigen::Vector3d& corner : member.camera.detector_corner_points()) {
      const Eigen::Vector3d direction = planes.slab_from_ct * (pose.inverse() * corner) - source;
      const double u =
          source.x() + (planes.uv_plane_y_mm - source.y()) / direction.y() * direction.x();
      low = std::min(low, u);
      high = std::max(high, u);
    }
  }
  return high - low;
}

/// Every member holds its own range whole, without the help of its neighbours, and about the axis
/// no more than its sources need.
TEST(Orbit, AMemberHoldsItsRangeOnPlanesAsNarrowAsItsSources) {
  constexpr double kMostSlack = 1.2;  // dual bounds are loose, samples miss the extremes
  HashRandom random(53);
  Orbit orbit;
  orbit.from_rad = -60.0 * kRadPerDeg;
  orbit.to_rad = 60.0 * kRadPerDeg;
  const MotionRange range{10.0 * kRadPerDeg, 30.0};
  const std::vector<OrbitMember> members =
      orbit_members(test::paper_camera(), {0, 0, 0}, {}, range, orbit);
  ASSERT_EQ(members.size(), 7U);
  for (const OrbitMember& member : members) {
    const LightSlab planes = planes_of(member.camera, {}, member.sized_for, {}, member.sources);
    const LightSlab of_all = planes_of(member.camera, {}, member.sized_for);
    EXPECT_GT(member.range.max_translation_mm(), 10.0);
    for (int i = 0; i < 500; ++i)
      ASSERT_TRUE(all_rays_inside(planes, member.camera, {}, sampled(member.range, i, random)));
    const double width = planes.u.last_mm - planes.u.first_mm;
    EXPECT_LT(width, kMostSlack * hit_width(planes, member, random));
    EXPECT_LT(width, 0.9 * (of_all.u.last_mm - of_all.u.first_mm));
    EXPECT_LE(planes.u.spacing_mm(), planes.v.spacing_mm());
    EXPECT_LE(planes.v.last_mm - planes.v.first_mm, of_all.v.last_mm - of_all.v.first_mm);
  }
}

TEST(Orbit, AboutZMembersTileAnglesOfCamerasAndPoses) {
  Orbit orbit;
  orbit.from_rad = -90.0 * kRadPerDeg;
  orbit.to_rad = 90.0 * kRadPerDeg;
  const MotionRange range{10.0 * kRadPerDeg, 30.0};
  const std::vector<OrbitMember> members =
      orbit_members(test::paper_camera(), {0, 0, 0}, {}, range, orbit);
  // -100 to 100 degrees in steps of at most 20, with a member about 0.
  ASSERT_EQ(members.size(), 11U);
  const double half = 100.0 / 11.0;
  EXPECT_NEAR(members.front().angle_rad * kDegPerRad, -10.0 * half, 1e-9);
  EXPECT_EQ(members[5].angle_rad, 0.0);
  EXPECT_EQ(members[5].camera.name, "AP_z0");
  EXPECT_EQ(members[6].camera.name, "AP_z18.18");
  EXPECT_EQ(members[5].camera.source_point, test::paper_camera().source_point);
  const MotionRange& of_member = members.front().sized_for;
  EXPECT_NEAR(of_member.high.rotation_rad.z() * kDegPerRad, half, 1e-6);
  EXPECT_EQ(of_member.high.rotation_rad.x(), range.high.rotation_rad.x());
  // A square of 30 mm turned as far as a camera and a pose of the same member can be apart.
  const double farthest = (10.0 + half) * kRadPerDeg;
  EXPECT_GE(of_member.high.translation_mm.x(), 30.0 * (std::cos(farthest) + std::sin(farthest)));
  EXPECT_LE(of_member.high.translation_mm.x(), 30.0 * std::numbers::sqrt2);
  EXPECT_EQ(of_member.high.translation_mm.z(), 30.0);
  // An orbit that excludes 0 is cut into equal parts.
  orbit.from_rad = 30.0 * kRadPerDeg;
  const std::vector<OrbitMember> beside =
      orbit_members(test::paper_camera(), {0, 0, 0}, {}, range, orbit);
  ASSERT_EQ(beside.size(), 4U);
  EXPECT_NEAR(beside[0].angle_rad * kDegPerRad, 30.0, 1e-9);
  EXPECT_NEAR(beside[3].angle_rad * kDegPerRad, 90.0, 1e-9);
  // Right-handed about z: from (0, -650, 0) at 90 degrees to (650, 0, 0).
  EXPECT_NEAR((beside[3].camera.source_point - Eigen::Vector3d(650, 0, 0)).norm(), 0.0, 1e-9);
}

TEST(Orbit, IsRefusedWhenItTakesTooManyFieldsOrIsNone) {
  const MotionRange range{10.0 * kRadPerDeg, 30.0};
  const auto members_of = [&](const Orbit& orbit) {
    return orbit_members(test::paper_camera(), {0, 0, 0}, {}, range, orbit);
  };
  EXPECT_THROW(members_of({2, 1.0, -1.0, {}}), InputError);
  EXPECT_THROW(members_of({2, -1.0, 1.0, 0.0}), InputError);
  EXPECT_THROW(members_of({2, -1.0, 1.0, 0.02}), InputError);
  EXPECT_THROW(members_of({2, -4.0, 4.0, {}}), InputError);
  EXPECT_EQ(members_of({0, 0.5, 0.5, {}}).size(), 1U);
}

TEST(CameraDistance, IsWhatACalibrationChanged) {
  const CameraGeometry nominal = test::paper_camera();
  EXPECT_TRUE(camera_distance(nominal, nominal).is_none());
  const CameraDistance distance =
      camera_distance(moved(nominal, {0, 0, 0.0174533}, {0, 0, 5}), nominal);
  EXPECT_NEAR(distance.rotation_deg, 1.0, 1e-5);
  // The source turns about the isocentre, 650 mm away: a chord of 2 * 650 sin(0.5 deg), and 5 mm.
  EXPECT_NEAR(distance.source_mm, std::hypot(1300.0 * std::sin(0.5 * 0.0174533), 5.0), 1e-6);
  EXPECT_NEAR(distance.source_detector_mm, 0.0, 1e-9);
  EXPECT_FALSE(distance.has_other_pixels);
  CameraGeometry finer = nominal;
  finer.pixel_spacing_mm /= 2.0;
  EXPECT_TRUE(camera_distance(finer, nominal).has_other_pixels);
  EXPECT_NE(camera_distance(finer, nominal).text().find("other pixels"), std::string::npos);
}

TEST(RayCoverage, NoPoseIsCoveredWhoseSourceComesWithinOrBehindTheAttenuation) {
  const CameraGeometry camera = test::paper_camera();
  const MotionRange range(0.02, 20.0);
  const LightSlab planes = planes_of(camera, {}, range);
  // The CT's box reaches up to 90 mm; a detector of one pixel keeps its lines within the planes.
  CameraGeometry near = test::c_arm_camera(1, 1, 1.0);
  near.source_point.y() = -115.0;
  const auto is_covered = [&](double mm) {
    return covers_range(planes, near, {}, MotionRange(0.0, mm));
  };
  EXPECT_TRUE(is_covered(10.0));
  EXPECT_FALSE(is_covered(30.0));
  EXPECT_NEAR(covered_box(planes, near, {}, MotionRange(0.0, 10.0)).max_translation_mm(),
              25.0,
              25.0 * kCoveredBoxTolerance);
  near.source_point.y() = -80.0;
  EXPECT_FALSE(is_covered(0.0));
  near.source_point.y() = 120.0;
  EXPECT_FALSE(is_covered(0.0));
}

}  // namespace
}  // namespace af
