// SPDX-License-Identifier: Apache-2.0
#include "ct/ray_caster.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/vector_width.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"

namespace af {
namespace {

using test::cube_grid;

/// Double-precision trilinear interpolation, zero outside, straight from the definition.
double brute_force_mu(const CtVolume& ct,
                      const AttenuationModel& model,
                      const Eigen::Vector3d& point_mm) {
  const Eigen::Vector3d index = ct.grid.index_of(point_mm);
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    std::array<int, 3> voxel{};
    for (int axis = 0; axis < 3; ++axis) {
      const double below = std::floor(index[axis]);
      const bool upper = (corner >> axis & 1) != 0;
      voxel[static_cast<std::size_t>(axis)] = static_cast<int>(below) + (upper ? 1 : 0);
      weight *= upper ? index[axis] - below : 1.0 - (index[axis] - below);
    }
    bool inside = true;
    for (std::size_t axis = 0; axis < 3; ++axis)
      inside = inside && voxel[axis] >= 0 && voxel[axis] < ct.grid.size[axis];
    if (!inside) continue;
    const auto offset = static_cast<std::size_t>(
        (voxel[2] * ct.grid.size[1] + voxel[1]) * ct.grid.size[0] + voxel[0]);
    sum += weight * model.relative_attenuation(ct.hu[offset]) * model.mu_per_mm_per_unit();
  }
  return sum;
}

double brute_force_integral(const CtVolume& ct,
                            const Eigen::Vector3d& source,
                            const Eigen::Vector3d& through,
                            double step_mm) {
  const Eigen::Vector3d direction = (through - source).normalized();
  constexpr double kReachMm = 2000.0;
  double sum = 0.0;
  for (double t = 0.5 * step_mm; t < kReachMm; t += step_mm)
    sum += brute_force_mu(ct, {}, source + t * direction);
  return sum * step_mm;
}

TEST(RayCaster, UniformBoxGivesMuTimesChordLength) {
  // Trilinear interpolation rounds the box's faces over one voxel but keeps the integral along an
  // axis exactly: 20 voxels of 1.5 mm at 0.02/mm. Midpoint samples of 0.05 mm integrate the linear
  // flanks to step^2; single precision sums of 700 samples keep 1e-5.
  const CtVolume ct = box_phantom(cube_grid(32, 1.5), {6, 6, 6}, {25, 25, 25}, 0);
  const AttenuationVolume volume(ct, {});
  const RayCaster caster(volume, {.step_mm = 0.05});
  constexpr double kTolerance = 1e-4;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3d source = Eigen::Vector3d::Constant(0.3);
    Eigen::Vector3d through = source;
    source[axis] = -500.0;
    through[axis] = 500.0;
    EXPECT_NEAR(caster.total_attenuation(source, through), 20 * 1.5 * 0.02, kTolerance)
        << "axis " << axis;
  }
}

TEST(RayCaster, ObliqueRayThroughBoxGivesMuTimesChordLength) {
  const CtVolume ct = box_phantom(cube_grid(32, 1.5), {6, 6, 6}, {25, 25, 25}, 0);
  const AttenuationVolume volume(ct, {});
  const RayCaster caster(volume, {.step_mm = 0.05});
  // Through two opposite faces well away from edges the rounded faces add as much as they take
  // away.
  const Eigen::Vector3d source(-400.0, 60.0, -40.0);
  const Eigen::Vector3d through = -source;
  const double chord_mm = 30.0 * source.norm() / 400.0;
  constexpr double kTolerance = 1e-4;
  EXPECT_NEAR(caster.total_attenuation(source, through), chord_mm * 0.02, kTolerance);
}

TEST(RayCaster, SphereAndEllipsoidGiveMuTimesChordLength) {
  Ellipsoid body;
  body.semi_axes_mm = {30.0, 20.0, 25.0};
  body.rotation = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  body.hu = 300;
  Ellipsoid sphere;
  sphere.semi_axes_mm = Eigen::Vector3d::Constant(25.0);
  sphere.hu = 300;
  for (const Ellipsoid& shape : {body, sphere}) {
    const CtVolume ct = ellipsoid_phantom(cube_grid(72, 1.0), {shape}, 4);
    const AttenuationVolume volume(ct, {});
    const RayCaster caster(volume, {.step_mm = 0.1});
    HashRandom random(1, 2);
    int compared = 0;
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d source =
          400.0 * Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
      const Eigen::Vector3d through(
          random.uniform(-15, 15), random.uniform(-15, 15), random.uniform(-15, 15));
      const double chord_mm = shape.chord_length_mm(source, through);
      // The surface is resolved to about a voxel (1 mm): partial volume averages to a small
      // fraction of one where the ray crosses it steeply, which chords over 20 mm do here.
      if (chord_mm < 20.0) continue;
      ++compared;
      constexpr double kHalfVoxelMm = 0.5;
      EXPECT_NEAR(
          caster.total_attenuation(source, through), chord_mm * 0.026, kHalfVoxelMm * 0.026);
    }
    EXPECT_GT(compared, 100);
  }
}

TEST(RayCaster, MissingRaysAreExactlyZero) {
  const CtVolume ct = box_phantom(cube_grid(16, 1.0), {4, 4, 4}, {11, 11, 11}, 1000);
  const AttenuationVolume volume(ct, {});
  const RayCaster caster(volume, {});
  EXPECT_EQ(caster.total_attenuation({-100, 0, 0}, {-100, 50, 0}), 0.0f);    // beside
  EXPECT_EQ(caster.total_attenuation({-100, 0, 0}, {-200, 0, 0}), 0.0f);     // away
  EXPECT_EQ(caster.total_attenuation({-100, 5.5, 0}, {100, 5.5, 0}), 0.0f);  // beyond the border
  EXPECT_GT(caster.total_attenuation({-100, 4.2, 0}, {100, 4.2, 0}), 0.0f);
}

TEST(RayCaster, GrazingRayAlongAFaceSeesTheRoundedFace) {
  const CtVolume ct = box_phantom(cube_grid(16, 1.0), {4, 4, 4}, {11, 11, 11}, 0);
  const AttenuationVolume volume(ct, {});
  const RayCaster caster(volume, {.step_mm = 0.05});
  // Half-way between the last voxel centre and the border voxel trilinear interpolation gives half
  // of mu.
  constexpr double kTolerance = 1e-4;
  EXPECT_NEAR(caster.total_attenuation({-100, 4.0, 0}, {100, 4.0, 0}), 0.5 * 0.02 * 8, kTolerance);
}

TEST(RayCaster, AgreesWithBruteForceOnRandomVolumesAndRays) {
  CtGrid grid;
  grid.size = {13, 9, 11};
  grid.spacing_mm = {2.0, 3.0, 1.5};
  grid.origin_mm = {-11.0, -14.0, -9.0};
  grid.direction =
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, -1, 2).normalized()).toRotationMatrix();
  std::vector<std::int16_t> hu(grid.voxel_count());
  for (std::size_t i = 0; i < hu.size(); ++i)
    hu[i] = static_cast<std::int16_t>(hash64(3, i) % 3000 - 1000);
  const CtVolume ct{grid, SharedArray<std::int16_t>(hu)};
  const AttenuationVolume volume(ct, {});
  const RayCaster caster(volume, {.step_mm = 0.01});
  HashRandom random(9);
  // Midpoint rule over piecewise polynomials with kinks every voxel: error per kink below slope
  // change * step^2.
  constexpr double kRelativeTolerance = 2e-3;
  for (int i = 0; i < 25; ++i) {
    const Eigen::Vector3d source =
        80.0 * Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
    const Eigen::Vector3d through(
        random.uniform(-8, 8), random.uniform(-8, 8), random.uniform(-6, 6));
    const double expected = brute_force_integral(ct, source, through, 0.01);
    EXPECT_NEAR(
        caster.total_attenuation(source, through), expected, kRelativeTolerance * expected + 1e-4);
  }
}

TEST(RayCaster, EveryVectorWidthGivesTheSameBits) {
  const CtVolume ct = ellipsoid_phantom(
      cube_grid(40, 1.3), {{{3, 2, 1}, {15, 20, 12}, Eigen::Matrix3d::Identity(), 700}}, 2);
  const AttenuationVolume volume(ct, {});
  const RayCaster caster(volume, {});
  const RayFan fan{{10, -500, 20}, {-30, 100, -30}, {1.7, 0.01, 0}, {0, 0, 1.9}, 37, 31};
  std::vector<float> first;
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    std::vector<float> values(37 * 31);
    caster.cast(fan, values);
    if (first.empty()) first = values;
    EXPECT_EQ(values, first) << to_string(width) << " bits";
  }
  force_vector_width(std::nullopt);
}

TEST(RayCaster, AnyNumberOfThreadsGivesTheSameBits) {
  const CtVolume ct = ellipsoid_phantom(
      cube_grid(40, 1.3), {{{3, 2, 1}, {15, 20, 12}, Eigen::Matrix3d::Identity(), 700}}, 2);
  const AttenuationVolume volume(ct, {});
  const RayCaster caster(volume, {});
  const RayFan fan{{10, -500, 20}, {-30, 100, -30}, {1.7, 0.01, 0}, {0, 0, 1.9}, 37, 31};
  std::vector<float> alone(37 * 31);
  caster.cast(fan, alone);
  for (const int threads : {2, 5}) {
    ThreadPool pool(threads);
    std::vector<float> values(37 * 31);
    caster.cast(fan, values, &pool);
    EXPECT_EQ(values, alone);
  }
}

TEST(RayCaster, FanEqualsItsSingleRays) {
  const CtVolume ct = box_phantom(cube_grid(24, 1.0), {5, 6, 7}, {15, 16, 17}, 400);
  const AttenuationVolume volume(ct, {});
  const RayCaster caster(volume, {});
  const RayFan fan{{10, -300, 20}, {-20, 50, -20}, {2.1, 0, 0}, {0, 0.1, 2.3}, 19, 5};
  std::vector<float> values(19 * 5);
  caster.cast(fan, values);
  // The fan's direction sums carry other roundings than the single ray's: a few units in the last
  // place of positions.
  constexpr float kTolerance = 1e-4f;
  for (int row = 0; row < 5; ++row)
    for (int column = 0; column < 19; ++column) {
      const float single = caster.total_attenuation(
          fan.source_point, fan.first_point + column * fan.column_step + row * fan.row_step);
      EXPECT_NEAR(values[static_cast<std::size_t>(row * 19 + column)], single, kTolerance);
    }
}

TEST(RayCasterOptions, RefusesSillySteps) {
  EXPECT_TRUE(problems(RayCasterOptions{}).empty());
  EXPECT_FALSE(problems(RayCasterOptions{.step_mm = 0.0}).empty());
  EXPECT_FALSE(problems(RayCasterOptions{.step_mm = std::nan("")}).empty());
}

}  // namespace
}  // namespace af
