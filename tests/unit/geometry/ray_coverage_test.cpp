// SPDX-License-Identifier: Apache-2.0
#include "geometry/ray_coverage.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "geometry/camera_distance.h"
#include "geometry/hit_extents.h"
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
                    std::span<const CameraGeometry> more = {}) {
  LightSlabSpec spec;
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

PoseParameters at(const MotionRange& range, const std::array<double, 6>& share) {
  PoseParameters parameters;
  for (int i = 0; i < 3; ++i) {
    const auto between = [](double low, double high, double x) { return low + x * (high - low); };
    const auto p = static_cast<std::size_t>(i);
    parameters.rotation_rad[i] =
        between(range.low.rotation_rad[i], range.high.rotation_rad[i], share[p]);
    parameters.translation_mm[i] =
        between(range.low.translation_mm[i], range.high.translation_mm[i], share[p + 3]);
  }
  return parameters;
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

/// Poses of a box: its corners first, then its faces and its inside.
PoseParameters sampled(const MotionRange& range, int index, HashRandom& random) {
  std::array<double, 6> share{};
  for (std::size_t p = 0; p < 6; ++p) {
    share[p] = random.uniform();
    if (index % 2 == 1 && random.uniform() < 0.5) share[p] = share[p] < 0.5 ? 0.0 : 1.0;
    if (index < 64) share[p] = (index >> p & 1) != 0 ? 1.0 : 0.0;
  }
  return at(range, share);
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
    // Of a box 5 % larger a corner's or a face's rays miss: extremes lie near corners at angles so
    // small.
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
  // A range beside zero: nothing about zero is covered.
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

}  // namespace
}  // namespace af
