// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/solid.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/hash_random.h"

namespace af {
namespace {

using Eigen::Vector3d;

Solid tilted(Solid::Shape shape) {
  Solid solid;
  solid.shape = shape;
  solid.center_mm = {3.0, -2.0, 1.0};
  solid.half_sizes_mm = {6.0, 9.0, 14.0};
  solid.rotation = Eigen::AngleAxisd(0.7, Vector3d(1.0, 2.0, -1.0).normalized()).toRotationMatrix();
  solid.hu = 0;
  return solid;
}

CtGrid cube_grid(int size, double spacing_mm) {
  CtGrid grid;
  grid.size = {size, size, size};
  grid.spacing_mm = Vector3d::Constant(spacing_mm);
  grid.origin_mm = Vector3d::Constant(-0.5 * (size - 1) * spacing_mm);
  return grid;
}

/// Volume of a sampled body of 0 HU in air.
double sampled_volume_mm3(const Solid& solid) {
  const CtVolume ct = sample_solids(cube_grid(60, 1.0), {solid}, 3, 1);
  double sum = 0.0;
  for (const std::int16_t hu : ct.hu.view()) sum += (hu + 1000) / 1000.0;
  return sum;
}

// Counting lattice points of 1/3 mm: the error of a smooth body's volume is far below one layer of
// points on its surface, 0.1 % of these volumes; rounding of each voxel to whole HU averages out.
constexpr double kVolumeTolerance = 2e-3;

TEST(Solid, SampledVolumesAreThoseOfTheShapes) {
  constexpr double kPi = std::numbers::pi;
  const double ellipsoid = 4.0 / 3.0 * kPi * 6.0 * 9.0 * 14.0;
  EXPECT_NEAR(
      sampled_volume_mm3(tilted(Solid::Shape::Ellipsoid)) / ellipsoid, 1.0, kVolumeTolerance);
  const double cylinder = kPi * 6.0 * 9.0 * 28.0;
  EXPECT_NEAR(
      sampled_volume_mm3(tilted(Solid::Shape::EllipticCylinder)) / cylinder, 1.0, kVolumeTolerance);
  const double capsule = kPi * 36.0 * 28.0 + 4.0 / 3.0 * kPi * 216.0;
  EXPECT_NEAR(sampled_volume_mm3(tilted(Solid::Shape::Capsule)) / capsule, 1.0, kVolumeTolerance);
}

TEST(Solid, WaistNarrowsACylinderAtHalfHeight) {
  Solid solid = tilted(Solid::Shape::EllipticCylinder);
  solid.rotation = Eigen::Matrix3d::Identity();
  solid.waist = 0.25;
  const auto at = [&](double x, double z) {
    return solid.contains(solid.center_mm + Vector3d(x, 0.0, z));
  };
  EXPECT_TRUE(at(5.9, 13.99));
  EXPECT_TRUE(at(4.4, 0.0));
  EXPECT_FALSE(at(4.6, 0.0));
  // Integral of (1 - w (1 - z^2))^2 over z in [-1, 1], halved: 1 - 4/3 w + 8/15 w^2.
  const double share = 1.0 - 4.0 / 3.0 * 0.25 + 8.0 / 15.0 * 0.0625;
  EXPECT_NEAR(sampled_volume_mm3(solid) / (std::numbers::pi * 6.0 * 9.0 * 28.0 * share),
              1.0,
              kVolumeTolerance);
}

TEST(Solid, SamplesHoldWhatTheBodyContains) {
  const CtGrid grid = cube_grid(45, 0.9);
  for (const auto shape : {Solid::Shape::Ellipsoid,
                           Solid::Shape::HalfEllipsoid,
                           Solid::Shape::EllipticCylinder,
                           Solid::Shape::Capsule})
    for (const double waist : {0.0, 0.3}) {
      Solid solid = tilted(shape);
      if (shape == Solid::Shape::EllipticCylinder) solid.waist = waist;
      solid.texture_hu = 200;
      const CtVolume ct = sample_solids(grid, {solid}, 1, 1);
      std::size_t voxel = 0;
      for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
          for (int i = 0; i < grid.size[0]; ++i, ++voxel) {
            const Vector3d point = grid.point_mm(Vector3d(i, j, k));
            // The two may differ in the rounding of a point.
            EXPECT_NEAR(ct.hu[voxel], solid.contains(point) ? solid.hu_at(point) : -1000, 1);
          }
    }
}

TEST(Solid, RoundsHuAsLround) {
  for (const double hu : {0.0,
                          0.5,
                          -0.5,
                          0.49999999999999994,
                          -0.49999999999999994,
                          2.5,
                          -2.5,
                          1023.4999999999999,
                          -999.5,
                          -1000.4,
                          9000.5})
    EXPECT_EQ(nearest_hu(hu), std::lround(hu)) << hu;
}

TEST(Solid, BoundsHoldEveryPointInside) {
  HashRandom random(4);
  for (const auto shape :
       {Solid::Shape::Ellipsoid, Solid::Shape::EllipticCylinder, Solid::Shape::Capsule}) {
    const Solid solid = tilted(shape);
    const CtBox box = solid.bounds();
    int inside = 0;
    for (int n = 0; n < 20000; ++n) {
      const Vector3d point = solid.center_mm + 25.0 * Vector3d(random.uniform(-1.0, 1.0),
                                                               random.uniform(-1.0, 1.0),
                                                               random.uniform(-1.0, 1.0));
      if (!solid.contains(point)) continue;
      ++inside;
      ASSERT_TRUE((point.array() >= box.low_mm.array()).all());
      ASSERT_TRUE((point.array() <= box.high_mm.array()).all());
    }
    EXPECT_GT(inside, 100);
  }
}

TEST(Solid, CapsuleJoinsItsEnds) {
  const Vector3d a(1.0, 2.0, 3.0);
  const Vector3d b(-4.0, 8.0, -2.0);
  const Solid capsule = capsule_between(a, b, 2.0, 700);
  EXPECT_TRUE(capsule.contains(a));
  EXPECT_TRUE(capsule.contains(b));
  EXPECT_TRUE(capsule.contains(0.3 * a + 0.7 * b));
  const Vector3d outward = (b - a).normalized();
  EXPECT_TRUE(capsule.contains(b + 1.99 * outward));
  EXPECT_FALSE(capsule.contains(b + 2.01 * outward));
}

TEST(SampleSolids, LaterBodiesReplaceEarlierOnes) {
  Solid outer;
  outer.half_sizes_mm = Vector3d::Constant(20.0);
  outer.hu = 40;
  Solid inner;
  inner.half_sizes_mm = Vector3d::Constant(10.0);
  inner.hu = -1000;
  const CtVolume ct = sample_solids(cube_grid(31, 2.0), {outer, inner}, 2, 1);
  const auto at = [&](int i) {
    return ct.hu[(std::size_t{15} * 31 + 15) * 31 + static_cast<std::size_t>(i)];
  };
  EXPECT_EQ(at(15), -1000);
  EXPECT_EQ(at(22), 40);
  EXPECT_EQ(at(30), -1000);
}

TEST(SampleSolids, VoxelsDoNotDependOnThreads) {
  Solid body = tilted(Solid::Shape::Ellipsoid);
  body.texture_hu = 100;
  const CtVolume one = sample_solids(cube_grid(40, 1.0), {body}, 2, 1);
  const CtVolume three = sample_solids(cube_grid(40, 1.0), {body}, 2, 3);
  EXPECT_TRUE(std::equal(one.hu.view().begin(), one.hu.view().end(), three.hu.view().begin()));
}

TEST(Texture, BlendsTheLatticeWhateverCameBefore) {
  // Far more cells than are remembered, also far away and below zero, each point asked for twice.
  const auto lattice = [](double i, double j, double k) {
    const auto key = [](double x) {
      return static_cast<std::uint64_t>(static_cast<std::int64_t>(x));
    };
    return 2.0 * static_cast<double>(hash64(key(i), key(j), key(k)) >> 11) * 0x1.0p-53 - 1.0;
  };
  std::vector<Vector3d> points;
  for (int i = 0; i < 5000; ++i) {
    HashRandom random(3, 4, static_cast<std::uint64_t>(i));
    const double reach_mm = i % 2 == 0 ? 40.0 : 1e6;
    const auto draw = [&] { return random.uniform(-reach_mm, reach_mm); };
    points.emplace_back(draw(), draw(), draw());
  }
  const auto expect_blend = [&](const Vector3d& point) {
    const Vector3d position = point / 3.0;
    const Vector3d low = position.array().floor();
    const Vector3d part = position - low;
    double expected = 0.0;
    for (const double i : {0.0, 1.0})
      for (const double j : {0.0, 1.0})
        for (const double k : {0.0, 1.0})
          expected += lattice(low.x() + i, low.y() + j, low.z() + k) *
                      (i == 0.0 ? 1.0 - part.x() : part.x()) *
                      (j == 0.0 ? 1.0 - part.y() : part.y()) *
                      (k == 0.0 ? 1.0 - part.z() : part.z());
    EXPECT_NEAR(texture(point, 3.0), expected, 1e-14) << point.transpose();
  };
  std::for_each(points.begin(), points.end(), expect_blend);
  std::for_each(points.rbegin(), points.rend(), expect_blend);
}

TEST(Texture, IsBoundedContinuousAndNotConstant) {
  double low = 1.0;
  double high = -1.0;
  for (int i = 0; i < 3000; ++i) {
    const Vector3d point(0.037 * i, -0.051 * i, 0.029 * i);
    const double value = texture(point, 3.0);
    low = std::min(low, value);
    high = std::max(high, value);
    // Along an axis the slope of a blend of values in [-1, 1] is at most 2 / scale.
    EXPECT_LE(std::abs(texture(point + Vector3d(1e-3, 0.0, 0.0), 3.0) - value), 1e-3);
  }
  EXPECT_GE(low, -1.0);
  EXPECT_LE(high, 1.0);
  EXPECT_LT(low, -0.4);
  EXPECT_GT(high, 0.4);
}

}  // namespace
}  // namespace af
