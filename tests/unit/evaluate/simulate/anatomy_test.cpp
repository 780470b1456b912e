// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/anatomy.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "evaluate/simulate/phantom.h"

namespace af {
namespace {

using Eigen::Vector3d;

TEST(Anatomy, TraitsAreIndependentAndTypicalWithoutASeed) {
  const Anatomy typical;
  EXPECT_EQ(typical.factor("ribs", 0.1, 3), 1.0);
  EXPECT_EQ(typical.shift("ribs", 5.0), 0.0);
  EXPECT_TRUE(typical.shift3("ribs", 5.0).isZero(0.0));
  EXPECT_EQ(typical.between("ribs", 3.0, 4.0, 7.0), 7.0);
  EXPECT_FALSE(typical.has("ribs", 1.0));
  EXPECT_EQ(typical.arthrosis(), 0.0);

  const Anatomy one("spine", 1);
  EXPECT_EQ(one.shift("a", 1.0), Anatomy("spine", 1).shift("a", 1.0));
  EXPECT_NE(one.shift("a", 1.0), one.shift("b", 1.0));
  EXPECT_NE(one.shift("a", 1.0), one.shift("a", 1.0, 1));
  EXPECT_NE(one.shift("a", 1.0), Anatomy("spine", 2).shift("a", 1.0));
  EXPECT_NE(one.shift("a", 1.0), Anatomy("head", 1).shift("a", 1.0));
}

TEST(Anatomy, NeighbouringPatientsAreNotCorrelated) {
  // 2000 pairs of independent values have a correlation of 0 +- 0.022: five times that.
  constexpr int kPatients = 2000;
  constexpr double kLargest = 5.0 * 0.0224;
  for (const int step : {1, 2}) {
    double sum = 0.0;
    double squares = 0.0;
    for (int i = 0; i < kPatients; ++i) {
      const double a = Anatomy("spine", static_cast<std::uint64_t>(i)).shift("size", 1.0);
      const double b = Anatomy("spine", static_cast<std::uint64_t>(i + step)).shift("size", 1.0);
      sum += a * b;
      squares += a * a;
    }
    EXPECT_LT(std::abs(sum / squares), kLargest) << step;
  }
}

TEST(Habitus, LeavesTheTypicalAdultAloneAndHasTheJacobianOfItsMap) {
  const Vector3d point(31.0, -17.0, 45.0);
  EXPECT_EQ(Habitus({}, 3.0, true)(point), point);
  const Habitus habitus(Anatomy("spine", 5), 3.0, true);
  const Vector3d step(0.01, -0.02, 0.015);
  // Second derivatives are at most 0.01 per mm: 1e-2 * |step|^2.
  EXPECT_LT((habitus(point + step) - habitus(point) - habitus.jacobian(point) * step).norm(), 1e-4);
}

TEST(ShapedPhantom, KeepsCapsulesJoined) {
  // Neighbouring pieces of a rib share an end point before the map, so they share one after it.
  const auto ends = [](const Solid& solid, double side) {
    return Vector3d(solid.center_mm + side * solid.half_sizes_mm.z() * solid.rotation.col(2));
  };
  Phantom phantom{{}, Vector3d::Constant(100.0), target_box_at(Vector3d::Zero(), 10.0), {}};
  const std::array<Vector3d, 3> chain{
      Vector3d(0.0, 0.0, 0.0), Vector3d(40.0, 5.0, 3.0), Vector3d(60.0, -30.0, 9.0)};
  phantom.solids = {capsule_between(chain[0], chain[1], 5.0, kCorticalHu),
                    capsule_between(chain[1], chain[2], 5.0, kCorticalHu)};
  const Anatomy anatomy("spine", 9);
  const Habitus habitus(anatomy, 3.0, true);
  const Phantom other = shaped(phantom, anatomy, habitus);
  EXPECT_LT((ends(other.solids[0], 1.0) - ends(other.solids[1], -1.0)).norm(), 1e-9);
  EXPECT_LT((ends(other.solids[0], 1.0) - habitus(chain[1])).norm(), 1e-9);
  EXPECT_GT((ends(other.solids[0], 1.0) - chain[1]).norm(), 0.1);
  EXPECT_NE(other.solids[0].hu, kCorticalHu);
}

class EveryAnatomy : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryAnatomy, IsOnePatientPerSeed) {
  const auto bodies = [](const Phantom& phantom) {
    Vector3d sum = Vector3d::Zero();
    for (const Solid& solid : phantom.solids) sum += solid.center_mm + solid.half_sizes_mm;
    return sum;
  };
  const Phantom typical = make_phantom(GetParam(), false);
  const Phantom one = make_phantom(GetParam(), false, 1);
  EXPECT_EQ(bodies(one), bodies(make_phantom(GetParam(), false, 1)));
  EXPECT_NE(bodies(one), bodies(make_phantom(GetParam(), false, 2)));
  EXPECT_NE(bodies(one), bodies(typical));
  EXPECT_TRUE(typical.findings.empty());
}

TEST_P(EveryAnatomy, HasItsTargetInBoneWithinTheVolume) {
  for (std::int64_t seed = 1; seed <= 12; ++seed) {
    const Phantom phantom = make_phantom(GetParam(), false, seed);
    const CtBox& box = phantom.target.box_ct;
    EXPECT_TRUE((box.low_mm.array() > -phantom.half_sizes_mm.array()).all()) << seed;
    EXPECT_TRUE((box.high_mm.array() < phantom.half_sizes_mm.array()).all()) << seed;
    CtGrid grid;
    grid.size = {15, 15, 15};
    grid.spacing_mm = (box.high_mm - box.low_mm) / 15.0;
    grid.origin_mm = box.low_mm + 0.5 * grid.spacing_mm;
    const CtVolume ct = sample_solids(grid, phantom.solids, 1, 1);
    const auto bone = std::count_if(
        ct.hu.view().begin(), ct.hu.view().end(), [](std::int16_t hu) { return hu > 120; });
    EXPECT_GT(bone, static_cast<std::ptrdiff_t>(grid.voxel_count() / 8)) << seed;
  }
}

TEST_P(EveryAnatomy, SometimesHasImplants) {
  int metal = 0;
  constexpr int kPatients = 60;
  for (std::int64_t seed = 1; seed <= kPatients; ++seed)
    metal += make_phantom(GetParam(), false, seed).has_metal() ? 1 : 0;
  EXPECT_GT(metal, kPatients / 10);
  EXPECT_LT(metal, kPatients);
  EXPECT_TRUE(make_phantom(GetParam(), true, 1).has_metal());
}

INSTANTIATE_TEST_SUITE_P(Phantoms,
                         EveryAnatomy,
                         ::testing::ValuesIn(phantom_names()),
                         [](const auto& instance) { return instance.param; });

}  // namespace
}  // namespace af
