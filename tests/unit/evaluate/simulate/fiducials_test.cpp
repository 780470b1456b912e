// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/fiducials.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

using Eigen::Vector3d;

// Positions up to 1000 mm in double: rounding 1e-13 mm, divided by sines down to 0.1 and square
// roots near tangency.
constexpr double kChordToleranceMm = 1e-6;

SteelCylinder tilted_pin() {
  SteelCylinder pin;
  pin.center_point = {3.0, -4.0, 5.0};
  pin.axis_direction = Vector3d(1.0, 2.0, 2.0) / 3.0;
  return pin;
}

TEST(SteelCylinder, ChordsHaveTheirClosedForms) {
  const SteelCylinder pin = tilted_pin();
  const Vector3d across = pin.axis_direction.unitOrthogonal();
  const Vector3d other = pin.axis_direction.cross(across);
  const auto chord = [&](const Vector3d& point, const Vector3d& direction) {
    return pin.chord_length_mm(point - 500.0 * direction.normalized(), point);
  };
  const Vector3d center = pin.center_point;
  EXPECT_NEAR(chord(center, across), 2.0, kChordToleranceMm);
  EXPECT_NEAR(chord(center, pin.axis_direction), 6.0, kChordToleranceMm);
  // Off the axis by 0.6 radii: 2 * 0.8.
  EXPECT_NEAR(chord(center + 0.6 * other, across), 1.6, kChordToleranceMm);
  // At 45 degrees through the centre: diameter * sqrt 2, well within the ends.
  EXPECT_NEAR(chord(center, across + pin.axis_direction), 2.0 * std::sqrt(2.0), kChordToleranceMm);
  // Through one end face's centre at 45 degrees: from the face to the side.
  EXPECT_NEAR(chord(center + 3.0 * pin.axis_direction, across + pin.axis_direction),
              std::sqrt(2.0),
              kChordToleranceMm);
  EXPECT_EQ(chord(center + 1.01 * other, across), 0.0);
  EXPECT_EQ(chord(center + 3.01 * pin.axis_direction, across), 0.0);
  EXPECT_EQ(chord(center + 1.01 * across, pin.axis_direction), 0.0);
}

TEST(SteelCylinder, IsMetOnlyInFrontOfTheSource) {
  const SteelCylinder pin = tilted_pin();
  const Vector3d across = pin.axis_direction.unitOrthogonal();
  const Vector3d away = pin.center_point + 50.0 * across;
  EXPECT_EQ(pin.chord_length_mm(away, away + across), 0.0);
  EXPECT_NEAR(pin.chord_length_mm(pin.center_point, away), 1.0, kChordToleranceMm);
}

TEST(SteelCylinder, ChordsSumToItsVolume) {
  const SteelCylinder pin = tilted_pin();
  // Parallel rays on a square lattice of 0.05 mm; the midpoint rule on a body whose chord vanishes
  // like a square root at its silhouette errs by about h^1.5 * perimeter (16 mm), here 0.18 mm^3 at
  // worst; measured an order below.
  constexpr double kPitchMm = 0.05;
  constexpr double kVolumeToleranceMm3 = 0.18;
  const Vector3d direction = Vector3d(2.0, -1.0, 0.7).normalized();
  const Vector3d u = direction.unitOrthogonal();
  const Vector3d v = direction.cross(u);
  double sum = 0.0;
  for (int i = -80; i < 80; ++i)
    for (int j = -80; j < 80; ++j) {
      const Vector3d point = pin.center_point + kPitchMm * ((i + 0.5) * u + (j + 0.5) * v);
      sum += pin.chord_length_mm(point - 100.0 * direction, point);
    }
  EXPECT_NEAR(sum * kPitchMm * kPitchMm, 6.0 * M_PI, kVolumeToleranceMm3);
}

CtVolume soft_block_with_bone(const Vector3d& bone_center_mm) {
  CtGrid grid;
  grid.size = {60, 60, 60};
  grid.origin_mm = Vector3d::Constant(-59.0);
  grid.spacing_mm = Vector3d::Constant(2.0);
  Ellipsoid tissue;
  tissue.semi_axes_mm = Vector3d::Constant(55.0);
  tissue.hu = 40;
  Ellipsoid bone;
  bone.center_mm = bone_center_mm;
  bone.semi_axes_mm = Vector3d::Constant(4.0);
  bone.hu = 900;
  return ellipsoid_phantom(grid, {tissue, bone}, 1);
}

double least_distance_mm(const std::vector<SteelCylinder>& pins) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < pins.size(); ++a)
    for (std::size_t b = a + 1; b < pins.size(); ++b)
      least = std::min(least, (pins[a].center_point - pins[b].center_point).norm());
  return least;
}

/// Volume of the tetrahedron of four pins.
double volume_mm3(const std::vector<SteelCylinder>& pins) {
  const Vector3d a = pins[1].center_point - pins[0].center_point;
  const Vector3d b = pins[2].center_point - pins[0].center_point;
  const Vector3d c = pins[3].center_point - pins[0].center_point;
  return std::abs(a.dot(b.cross(c))) / 6.0;
}

TEST(PlaceFiducials, FormsARegularTetrahedronWhereThereIsNoBone) {
  const auto pins = place_fiducials(soft_block_with_bone({45.0, 0.0, 0.0}), {1.0, 2.0, 3.0});
  ASSERT_EQ(pins.size(), 4u);
  EXPECT_NEAR(least_distance_mm(pins), 25.0, 1e-12);
  EXPECT_NEAR(volume_mm3(pins), std::pow(25.0, 3) / (6.0 * std::sqrt(2.0)), 1e-9);
}

TEST(PlaceFiducials, MovesAPinIntoNearbyBone) {
  const Vector3d bone(14.0, 10.0, 12.0);  // 6.8 mm from the corner (8.84, 8.84, 8.84)
  const CtVolume ct = soft_block_with_bone(bone);
  const auto pins = place_fiducials(ct, Vector3d::Zero());
  EXPECT_LE((pins[0].center_point - bone).norm(), 4.0);
  EXPECT_GE(least_distance_mm(pins), 15.0);
  EXPECT_GT(volume_mm3(pins), 1000.0);
}

TEST(PlaceFiducials, StaysInsideTheSearchAtTheCtsEdge) {
  const auto pins = place_fiducials(soft_block_with_bone({0.0, 0.0, 0.0}), {500.0, 0.0, 0.0});
  EXPECT_EQ(pins.size(), 4u);
  EXPECT_NEAR(least_distance_mm(pins), 25.0, 1e-12);
}

CameraGeometry camera_512() {
  CameraGeometry camera;
  camera.name = "A";
  camera.source_point = {0.0, -2600.0, 0.0};
  camera.detector_origin_point = {-102.2, 1000.0, 102.2};
  camera.column_direction = {1.0, 0.0, 0.0};
  camera.row_direction = {0.0, 0.0, -1.0};
  camera.pixel_spacing_mm = {0.4, 0.4};
  camera.size_px = {512, 512};
  return camera;
}

TEST(DetectFiducials, AreExactProjectionsWithoutNoiseAndScatterByTheStatedSigma) {
  const CameraGeometry camera = camera_512();
  constexpr double kSigmaPx = 0.2;
  constexpr std::size_t kPins = 5000;
  std::vector<SteelCylinder> pins(kPins);
  const RigidTransform pose = RigidTransform::Identity();
  const auto exact = detect_fiducials(camera, pose, pins, 0.0, 1, 2);
  const auto noisy = detect_fiducials(camera, pose, pins, kSigmaPx, 1, 2);
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (std::size_t i = 0; i < kPins; ++i) {
    EXPECT_EQ(exact[i], camera.project(pins[i].center_point));
    for (int axis = 0; axis < 2; ++axis) {
      const double error = noisy[i][axis] - exact[i][axis];
      sum += error;
      sum_of_squares += error * error;
    }
  }
  // Five standard errors of 2 * 5000 normal draws.
  constexpr double kDraws = 2.0 * kPins;
  EXPECT_NEAR(sum / kDraws, 0.0, 5.0 * kSigmaPx / std::sqrt(kDraws));
  EXPECT_NEAR(sum_of_squares / kDraws,
              kSigmaPx * kSigmaPx,
              5.0 * kSigmaPx * kSigmaPx * std::sqrt(2.0 / kDraws));
}

TEST(DetectFiducials, DependOnSeedAndKeyOnly) {
  const std::vector<SteelCylinder> pins(4);
  const RigidTransform pose = RigidTransform::Identity();
  const auto at = [&](std::uint64_t seed, std::uint64_t key) {
    return detect_fiducials(camera_512(), pose, pins, 0.2, seed, key);
  };
  EXPECT_EQ(at(1, 2), at(1, 2));
  EXPECT_NE(at(1, 2), at(2, 2));
  EXPECT_NE(at(1, 2), at(1, 3));
}

}  // namespace
}  // namespace af
