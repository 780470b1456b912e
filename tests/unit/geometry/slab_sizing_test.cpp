// SPDX-License-Identifier: Apache-2.0
#include "geometry/slab_sizing.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/ct_box.h"
#include "support/c_arm_camera.h"
#include "unit/geometry/closed_form_plane_sizes.h"

namespace af {
namespace {

/// A camera that is neither aimed at the centre nor square nor axis-aligned.
CameraGeometry skewed_camera() {
  const Eigen::Matrix3d turn = (Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) *
                                Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitX()))
                                   .toRotationMatrix();
  CameraGeometry camera;
  camera.name = "oblique";
  camera.source_point = turn * Eigen::Vector3d(30.0, -900.0, -20.0);
  camera.column_direction = turn * Eigen::Vector3d(1.0, 0.0, 0.0);
  camera.row_direction = turn * Eigen::Vector3d(0.0, 0.0, -1.0);
  camera.pixel_spacing_mm = {0.8, 1.1};
  camera.size_px = {300, 180};
  camera.detector_origin_point = turn * Eigen::Vector3d(-80.0, 400.0, 130.0);
  return camera;
}

MotionRange range_of(double degrees, double translation_mm) {
  return {degrees * kRadPerDeg, translation_mm};
}

double half_field_of_view_rad() {
  return std::atan(152.4 / 1020.0);
}

struct PaperRow {
  double degrees, translation_mm, st_mm, uv_mm;
};

// Values of the restored eqs. (4)-(10); the table gives one or two decimals.
constexpr PaperRow kCameraMoved[] = {{10, 100, 524.90, 560.03},
                                     {5, 50, 343.75, 251.92},
                                     {20, 100, 687.48, 1087.55},
                                     {10, 0, 244.32, 279.45}};
constexpr double kTableRounding = 0.006;

TEST(ClosedFormPlaneSizes, GiveThePapersCaseToTheTablesRounding) {
  for (const PaperRow& row : kCameraMoved) {
    const auto sizes = test::closed_form_plane_sizes({half_field_of_view_rad(), 650.0},
                                                     range_of(row.degrees, row.translation_mm));
    EXPECT_NEAR(sizes.st_side_mm, row.st_mm, kTableRounding) << row.degrees << " deg";
    EXPECT_NEAR(sizes.uv_side_mm, row.uv_mm, kTableRounding) << row.degrees << " deg";
  }
}

TEST(ClosedFormPlaneSizes, RefuseARangeThatMakesRaysParallelToThePlanes) {
  EXPECT_THROW(test::closed_form_plane_sizes({half_field_of_view_rad(), 650.0}, range_of(50, 0)),
               InputError);
}

TEST(SmallAnglePlaneSizes, FallShortByTheStatedShares) {
  // Shares stated for the first-order form: 6.5 % and 5.2 % at 10 degrees, 19 % and 16 % at 20
  // degrees, to two digits.
  const test::SymmetricCamera camera{half_field_of_view_rad(), 650.0};
  const auto shortfall = [&](double degrees, auto side) {
    const auto range = range_of(degrees, 100);
    return 1.0 - side(test::small_angle_plane_sizes(camera, range)) /
                     side(test::closed_form_plane_sizes(camera, range));
  };
  const auto st = [](const test::SymmetricPlaneSizes& sizes) { return sizes.st_side_mm; };
  const auto uv = [](const test::SymmetricPlaneSizes& sizes) { return sizes.uv_side_mm; };
  EXPECT_NEAR(shortfall(10, st), 0.065, 0.0005);
  EXPECT_NEAR(shortfall(10, uv), 0.052, 0.0005);
  EXPECT_NEAR(shortfall(20, st), 0.19, 0.005);
  EXPECT_NEAR(shortfall(20, uv), 0.16, 0.005);
}

TEST(ClosedFormPlaneSizes, EqualTheCornerSearchOfEquationThree) {
  // Eq. (3) by brute force: all rotation corners, frustum corners and translation corners of a
  // camera moved by T = T_t Rz Ry Rx, in the paper's frame (source on +y).
  const double k = std::tan(half_field_of_view_rad());
  for (const PaperRow& row : kCameraMoved) {
    double st = 0.0;
    double uv = 0.0;
    for (int corner = 0; corner < 256; ++corner) {
      const auto sign = [&](int bit) { return (corner >> bit & 1) != 0 ? 1.0 : -1.0; };
      const Eigen::Matrix3d rotation = rotation_from_angles(
          row.degrees * kRadPerDeg * Eigen::Vector3d(sign(0), sign(1), sign(2)));
      const Eigen::Vector3d point = rotation * Eigen::Vector3d(0, 650, 0) +
                                    row.translation_mm * Eigen::Vector3d(sign(3), sign(4), sign(5));
      const Eigen::Vector3d direction = rotation * Eigen::Vector3d(k * sign(6), -1.0, k * sign(7));
      st = std::max(st, 2.0 * std::abs((point - point.y() / direction.y() * direction).x()));
      uv = std::max(uv,
                    2.0 * std::abs((point + (650.0 - point.y()) / direction.y() * direction).x()));
    }
    EXPECT_NEAR(st, row.st_mm, kTableRounding);
    EXPECT_NEAR(uv, row.uv_mm, kTableRounding);
  }
}

TEST(SlabSizing, GivesTheStatedSizesForAMovedCt) {
  struct Row {
    double degrees, translation_mm, st_mm, uv_mm;
  };
  // The larger of x and z extents, one decimal.
  constexpr Row kRows[] = {{10, 100, 533.8, 568.6},
                           {5, 50, 346.9, 254.2},
                           {20, 100, 711.2, 1111.3},
                           {10, 0, 244.4, 279.5}};
  for (const Row& row : kRows) {
    const std::array<double, 2> planes{0.0, 650.0};
    const auto extents = extents_on_planes(
        test::paper_camera(), {}, range_of(row.degrees, row.translation_mm), planes);
    const auto side = [](const PlaneExtent& extent) {
      return std::max({2 * std::abs(extent.x_low_mm),
                       2 * extent.x_high_mm,
                       2 * std::abs(extent.z_low_mm),
                       2 * extent.z_high_mm});
    };
    constexpr double kOneDecimal = 0.06;
    EXPECT_NEAR(side(extents[0]), row.st_mm, kOneDecimal) << row.degrees << " deg";
    EXPECT_NEAR(side(extents[1]), row.uv_mm, kOneDecimal) << row.degrees << " deg";
  }
}

struct MovingCase {
  CameraGeometry camera;
  PoseFrame frame;
  MotionRange range;
};

std::vector<MovingCase> moving_cases() {
  PoseFrame tilted;
  tilted.rotation = rotation_from_angles({0.2, -0.3, 0.5});
  tilted.center_ct_mm = {12.0, -30.0, 44.0};
  tilted.center_room_mm = {5.0, 8.0, -9.0};
  return {{test::paper_camera(), {}, range_of(10, 100)},
          {test::paper_camera(), {}, range_of(30, 20)},
          {skewed_camera(), tilted, range_of(15, 60)},
          {skewed_camera(), tilted, range_of(30, 0)},
          {skewed_camera(), tilted, range_of(0, 0)}};
}

std::array<Eigen::Vector3d, 8> small_ct_corners(const PoseFrame& frame) {
  return CtBox{frame.center_ct_mm - Eigen::Vector3d(90, 90, 90),
               frame.center_ct_mm + Eigen::Vector3d(90, 90, 90)}
      .corner_points();
}

/// Number of detector corner rays that miss a plane at a pose.
int missing_rays(const MovingCase& moving,
                 const LightSlab& light_slab,
                 const PoseParameters& parameters) {
  const RigidTransform slab_from_room =
      light_slab.slab_from_ct * pose_from_parameters(moving.frame, parameters).inverse();
  int missing = 0;
  for (const Eigen::Vector3d& corner : moving.camera.detector_corner_points())
    for (const SlabGeometry& slab : light_slab.slabs) {
      const Ray ray{slab_from_room * moving.camera.source_point,
                    (slab_from_room.linear() * (corner - moving.camera.source_point)).normalized()};
      missing += light_slab.intersect(ray, slab) ? 0 : 1;
    }
  return missing;
}

/// How close to leaving a rectangle the most extreme ray comes: >= 0 outside.
double worst_excess(const MovingCase& moving,
                    const LightSlab& light_slab,
                    const PoseParameters& parameters) {
  const RigidTransform slab_from_room =
      light_slab.slab_from_ct * pose_from_parameters(moving.frame, parameters).inverse();
  const Eigen::Vector3d source = slab_from_room * moving.camera.source_point;
  double excess = -1e300;
  const auto include = [&](double value, const GridAxis& axis) {
    excess = std::max({excess, value - axis.last_mm, axis.first_mm - value});
  };
  for (const Eigen::Vector3d& corner : moving.camera.detector_corner_points()) {
    const Eigen::Vector3d direction = slab_from_room * corner - source;
    const Eigen::Vector3d at_uv =
        source + (light_slab.uv_plane_y_mm - source.y()) / direction.y() * direction;
    include(at_uv.x(), light_slab.u);
    include(at_uv.z(), light_slab.v);
    for (const SlabGeometry& slab : light_slab.slabs) {
      const Eigen::Vector3d at_st =
          source + (slab.st_plane_y_mm - source.y()) / direction.y() * direction;
      include(at_st.x(), slab.s);
      include(at_st.z(), slab.t);
    }
  }
  return excess;
}

PoseParameters within(const MotionRange& range, const std::array<double, 6>& unit) {
  PoseParameters parameters;
  for (int i = 0; i < 3; ++i) {
    parameters.rotation_rad[i] = range.max_rotation_rad() * unit[static_cast<std::size_t>(i)];
    parameters.translation_mm[i] =
        range.max_translation_mm() * unit[static_cast<std::size_t>(i) + 3];
  }
  return parameters;
}

TEST(SlabSizing, NoInRangeRayMissesAPlane) {
  for (const MovingCase& moving : moving_cases()) {
    LightSlabSpec spec;
    spec.slab_boundaries_y_mm = {-10.0, 25.0};
    spec.st_plane_y_mm = {-40.0, 5.0, 60.0};
    const LightSlab light_slab = make_light_slab(
        moving.camera, moving.frame, moving.range, small_ct_corners(moving.frame), spec);
    HashRandom random(11);
    for (int i = 0; i < 4000; ++i) {
      // Random poses, poses on the box's faces, and its 64 corners.
      std::array<double, 6> unit{};
      for (std::size_t p = 0; p < 6; ++p) {
        unit[p] = random.uniform(-1.0, 1.0);
        if (i % 2 == 1 && random.uniform() < 0.5) unit[p] = unit[p] < 0.0 ? -1.0 : 1.0;
        if (i < 64) unit[p] = (i >> p & 1) != 0 ? 1.0 : -1.0;
      }
      ASSERT_EQ(missing_rays(moving, light_slab, within(moving.range, unit)), 0) << "pose " << i;
    }
    // Poses that climb towards leaving a rectangle: coordinate search from random starts with
    // shrinking steps.
    for (int start = 0; start < 30; ++start) {
      std::array<double, 6> unit{};
      for (double& value : unit) value = random.uniform(-1.0, 1.0);
      double best = worst_excess(moving, light_slab, within(moving.range, unit));
      for (double step = 0.5; step > 1e-5;) {
        bool improved = false;
        for (std::size_t p = 0; p < 6; ++p)
          for (const double sign : {-1.0, 1.0}) {
            auto moved = unit;
            moved[p] = std::clamp(moved[p] + sign * step, -1.0, 1.0);
            const double excess = worst_excess(moving, light_slab, within(moving.range, moved));
            if (!(excess > best)) continue;
            best = excess;
            unit = moved;
            improved = true;
          }
        if (!improved) step /= 2.0;
      }
      EXPECT_LE(best, 0.0) << "a ray leaves its rectangle by " << best << " mm";
      EXPECT_EQ(missing_rays(moving, light_slab, within(moving.range, unit)), 0);
    }
  }
}

TEST(SlabSizing, PlanesAreNoLargerThanTheirMostExtremeRay) {
  // Tightness: some pose in range comes within 0.1 % of every edge, or sizing would waste nodes.
  const MovingCase moving = moving_cases()[0];
  const LightSlab light_slab = make_light_slab(
      moving.camera, moving.frame, moving.range, small_ct_corners(moving.frame), {});
  double s_high = -1e300;
  for (int corner = 0; corner < 64; ++corner) {
    std::array<double, 6> unit{};
    for (std::size_t p = 0; p < 6; ++p) unit[p] = (corner >> p & 1) != 0 ? 1.0 : -1.0;
    const RigidTransform slab_from_room =
        light_slab.slab_from_ct *
        pose_from_parameters(moving.frame, within(moving.range, unit)).inverse();
    const Eigen::Vector3d source = slab_from_room * moving.camera.source_point;
    for (const Eigen::Vector3d& detector_corner : moving.camera.detector_corner_points()) {
      const Eigen::Vector3d direction = slab_from_room * detector_corner - source;
      s_high = std::max(s_high, (source - source.y() / direction.y() * direction).x());
    }
  }
  EXPECT_NEAR(s_high, light_slab.slabs[0].s.last_mm, 1e-3 * light_slab.slabs[0].s.last_mm);
}

TEST(LightSlab, StoredRangeHoldsTheShadowAndIsEvenAligned) {
  const MovingCase moving = moving_cases()[0];
  LightSlabSpec spec;
  spec.st_nodes = 101;
  const auto corners = small_ct_corners(moving.frame);
  const LightSlab light_slab =
      make_light_slab(moving.camera, moving.frame, moving.range, corners, spec);
  const SlabGeometry& slab = light_slab.slabs[0];
  EXPECT_EQ(slab.stored_s.begin % 2, 0);
  EXPECT_TRUE(slab.stored_s.count % 2 == 0 || slab.stored_s.end() == slab.s.nodes);
  EXPECT_LT(slab.stored_s.count, slab.s.nodes) << "a 180 mm CT must not need the whole plane";
  HashRandom random(5);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d in_ct =
        corners[0] +
        Eigen::Vector3d(random.uniform(0, 180), random.uniform(0, 180), random.uniform(0, 180));
    const Eigen::Vector3d viewpoint(random.uniform(light_slab.u.first_mm, light_slab.u.last_mm),
                                    light_slab.uv_plane_y_mm,
                                    random.uniform(light_slab.v.first_mm, light_slab.v.last_mm));
    const Eigen::Vector3d direction = light_slab.slab_from_ct * in_ct - viewpoint;
    const Eigen::Vector3d hit = viewpoint - viewpoint.y() / direction.y() * direction;
    // Every node next to a shadowed point is stored, unless the lattice ends there.
    const double s = slab.s.node_coordinate(hit.x());
    if (s < 0 || s > slab.s.nodes - 1) continue;
    EXPECT_GE(std::floor(s), slab.stored_s.begin);
    EXPECT_LE(std::ceil(s), slab.stored_s.end() - 1);
  }
}

TEST(LightSlab, SourceWithinTheCtsDepthIsRefused) {
  const auto corners = CtBox{{-100, -600, -100}, {100, 100, 100}}.corner_points();
  EXPECT_THROW(make_light_slab(test::paper_camera(), {}, range_of(10, 100), corners, {}),
               InputError);
}

TEST(LightSlab, RangeThatMakesRaysParallelToThePlanesIsRefused) {
  const std::array<double, 1> planes{0.0};
  EXPECT_THROW(extents_on_planes(test::paper_camera(), {}, range_of(60, 0), planes), InputError);
}

}  // namespace
}  // namespace af
