// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/xray_simulator.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drr/material_tables.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

using Eigen::Vector3d;

CameraGeometry small_camera() {
  CameraGeometry camera;
  camera.name = "A";
  camera.source_point = {0.0, -600.0, 0.0};
  camera.detector_origin_point = {-94.5, 300.0, 94.5};
  camera.column_direction = {1.0, 0.0, 0.0};
  camera.row_direction = {0.0, 0.0, -1.0};
  camera.pixel_spacing_mm = {3.0, 3.0};
  camera.size_px = {64, 64};
  return camera;
}

class XraySimulatorOfABlock : public ::testing::Test {
 protected:
  XraySimulatorOfABlock() {
    grid_.size = {60, 50, 60};
    grid_.spacing_mm = Vector3d::Constant(2.0);
    grid_.origin_mm = Vector3d(-59.0, -49.0, -59.0);
  }
  // 300 HU, 60 mm (x) by 60 mm (y) by 60 mm (z), faces at +-30 mm.
  CtVolume block() const { return box_phantom(grid_, {15, 10, 15}, {44, 39, 44}, 300); }

  CtGrid grid_;
  CameraGeometry camera_ = small_camera();
  View view_{camera_, {22, 22, 20, 20}};
};

TEST_F(XraySimulatorOfABlock, WithEveryEffectOffIsBeerLambertOfTheExactIntegral) {
  // The contract's 1e-4, which float pixels meet with a margin: U errs by about 2^-24.
  constexpr double kTolerance = 1e-6;
  const AttenuationVolume volume(block(), {});
  const XraySimulationOptions options = XraySimulationOptions::ideal();
  const XraySimulator simulator(volume, {}, options);
  const Image2d image = simulator.xray(view_, RigidTransform::Identity(), 1, 2);
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column) {
      const Ray ray = camera_.ray(column, row);
      // Rays that stay within the block's sides cross it from y = -30 to y = 30.
      const Vector3d leaves = ray.origin_point + 630.0 / ray.direction.y() * ray.direction;
      if (std::max(std::abs(leaves.x()), std::abs(leaves.z())) > 30.0) continue;
      const double exact = 0.0200 * 1.3 * 60.0 / ray.direction.y();
      const double level = static_cast<double>(image.at(column, row));
      ASSERT_NEAR(-std::log(level / options.detector.open_beam_level), exact, kTolerance);
    }
  EXPECT_EQ(image.at(0, 0), 4000.0f);  // open beam
}

TEST_F(XraySimulatorOfABlock, FollowsThePose) {
  const AttenuationVolume volume(block(), {});
  const XraySimulator simulator(volume, {}, XraySimulationOptions::ideal());
  RigidTransform moved = RigidTransform::Identity();
  moved.translation() = Vector3d(20.0, 0.0, 0.0);
  const Image2d still = simulator.primary_image(camera_, RigidTransform::Identity());
  const Image2d shifted = simulator.primary_image(camera_, moved);
  // 20 mm are 20 * 900 / 630 / 3 = 9.52 columns on the far face and 10.53 on the near one: the
  // shadow moves by something between.
  const auto middle_column = [](const Image2d& image) {
    double sum = 0.0;
    double weight = 0.0;
    for (int row = 0; row < image.height; ++row)
      for (int column = 0; column < image.width; ++column) {
        const double shade = 1.0 - static_cast<double>(image.at(column, row));
        sum += shade * column;
        weight += shade;
      }
    return sum / weight;
  };
  EXPECT_GT(middle_column(shifted) - middle_column(still), 9.52);
  EXPECT_LT(middle_column(shifted) - middle_column(still), 10.53);
}

TEST_F(XraySimulatorOfABlock, PinsDarkenByTheirChord) {
  constexpr double kTolerance = 1e-6;  // float pixels
  const AttenuationVolume volume(block(), {});
  SteelCylinder pin;
  pin.axis_direction = Vector3d::UnitY();  // seen end on: 6 mm
  CameraGeometry camera = camera_;
  camera.size_px = {65, 65};
  camera.detector_origin_point = {-96.0, 300.0, 96.0};  // pixel (32, 32) looks at the origin
  const Image2d with = XraySimulator(volume, {{pin}, {}}, XraySimulationOptions::ideal())
                           .primary_image(camera, RigidTransform::Identity());
  const Image2d without = XraySimulator(volume, {}, XraySimulationOptions::ideal())
                              .primary_image(camera, RigidTransform::Identity());
  const double difference = std::log(static_cast<double>(without.at(32, 32))) -
                            std::log(static_cast<double>(with.at(32, 32)));
  const double energy = effective_energy_kev(0.0200);
  EXPECT_NEAR(
      difference / (6.0 * linear_attenuation_per_mm(Material::Iron, energy)), 1.0, kTolerance);
  EXPECT_EQ(with.at(20, 20), without.at(20, 20));
}

TEST_F(XraySimulatorOfABlock, XraysDependOnSeedAndKeyButNotOnThreads) {
  const AttenuationVolume volume(block(), {});
  XraySimulationOptions options;
  options.threads = 1;
  const RigidTransform pose = RigidTransform::Identity();
  const XraySimulator one(volume, {}, options);
  options.threads = 3;
  const XraySimulator three(volume, {}, options);
  const Image2d image = one.xray(view_, pose, 7, 8);
  EXPECT_EQ(image.pixels, three.xray(view_, pose, 7, 8).pixels);
  EXPECT_NE(image.pixels, one.xray(view_, pose, 8, 8).pixels);
  EXPECT_NE(image.pixels, one.xray(view_, pose, 7, 9).pixels);
}

TEST(XraySimulationOptions, CollectsTheProblemsOfAllParts) {
  EXPECT_TRUE(problems(XraySimulationOptions{}).empty());
  EXPECT_TRUE(problems(XraySimulationOptions::ideal()).empty());
  XraySimulationOptions bad;
  bad.spectrum.tube_kvp = 10.0;
  bad.detector.bits = 20;
  bad.threads = -1;
  EXPECT_THAT(problems(bad),
              ::testing::ElementsAre(::testing::HasSubstr("tube_kvp"),
                                     ::testing::HasSubstr("bits"),
                                     ::testing::HasSubstr("threads")));
}

}  // namespace
}  // namespace af
