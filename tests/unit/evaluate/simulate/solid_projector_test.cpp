// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/solid_projector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "evaluate/simulate/phantom.h"
#include "evaluate/simulate/siddon_projector.h"
#include "evaluate/simulate/solid_chords.h"

namespace af {
namespace {

using Eigen::Vector3d;

// Roots of quadratics of lengths up to 1000 mm.
constexpr double kRootToleranceMm = 1e-8;

const TissueModel& tissue() {
  static const TissueModel model{AttenuationModel()};
  return model;
}

Phantom phantom_of_bodies(std::vector<Solid> solids) {
  return {std::move(solids), Vector3d::Constant(100.0), target_box_at(Vector3d::Zero(), 10.0), {}};
}

double all_mm(const RayIntegrator& projector, const Vector3d& source, const Vector3d& through) {
  const PathIntegrals path = projector.integrate(source, through);
  return path.water_mm + path.bone_mm;
}

/// Every shape in turn, and cylinders with a waist and without.
Solid random_solid(HashRandom& random, int trial) {
  Solid solid;
  solid.shape = static_cast<Solid::Shape>(trial % 4);
  solid.half_sizes_mm = {
      random.uniform(3.0, 9.0), random.uniform(3.0, 9.0), random.uniform(3.0, 9.0)};
  solid.center_mm = {random.uniform(-2.0, 2.0), 0.5, -0.5};
  solid.rotation =
      Eigen::AngleAxisd(random.uniform(0.0, 3.0), Vector3d(1.0, 0.4, -0.7).normalized())
          .toRotationMatrix();
  if (solid.shape == Solid::Shape::EllipticCylinder) solid.waist = trial % 8 < 4 ? 0.1 : 0.0;
  return solid;
}

TEST(SolidProjector, EqualsClosedFormsOfSingleBodies) {
  const Vector3d source(0.0, -500.0, 0.0);
  const auto through_water = [&](const Solid& solid, const Vector3d& through) {
    return all_mm(SolidProjector(phantom_of_bodies({solid}), tissue()), source, through);
  };
  // A ball of 30 mm, 12 mm off the ray that runs along y: 2 sqrt(900 - 144).
  EXPECT_NEAR(
      through_water(ellipsoid({12.0, 0.0, 0.0}, Vector3d::Constant(30.0), 0), {0.0, 0.0, 0.0}),
      2.0 * std::sqrt(900.0 - 144.0),
      kRootToleranceMm);
  // An ellipsoid of half axes 10, 20, 30 through its middle along y.
  EXPECT_NEAR(through_water(ellipsoid(Vector3d::Zero(), {10.0, 20.0, 30.0}, 0), Vector3d::Zero()),
              40.0,
              kRootToleranceMm);
  // A cylinder along y: its length; a capsule along y: its length and two radii.
  Solid cylinder = elliptic_cylinder(Vector3d::Zero(), {8.0, 8.0, 25.0}, 0);
  cylinder.rotation = Eigen::AngleAxisd(M_PI / 2.0, Vector3d::UnitX()).toRotationMatrix();
  EXPECT_NEAR(through_water(cylinder, Vector3d::Zero()), 50.0, kRootToleranceMm);
  EXPECT_NEAR(
      through_water(capsule_between({0.0, -25.0, 0.0}, {0.0, 25.0, 0.0}, 6.0, 0), Vector3d::Zero()),
      62.0,
      kRootToleranceMm);
  // Half a ball whose flat side faces the source.
  Solid half = ellipsoid(Vector3d::Zero(), Vector3d::Constant(20.0), 0);
  half.shape = Solid::Shape::HalfEllipsoid;
  half.rotation = Eigen::AngleAxisd(-M_PI / 2.0, Vector3d::UnitX()).toRotationMatrix();
  EXPECT_NEAR(through_water(half, Vector3d::Zero()), 20.0, kRootToleranceMm);
  // A miss.
  EXPECT_EQ(through_water(half, {40.0, 0.0, 0.0}), 0.0);
}

TEST(SolidProjector, PaintsLaterBodiesOverEarlierOnes) {
  // 100 mm of water with 20 mm of gas in it, and bone of 10 mm within the gas.
  const Phantom phantom =
      phantom_of_bodies({ellipsoid(Vector3d::Zero(), Vector3d::Constant(50.0), 0),
                         ellipsoid({0.0, 10.0, 0.0}, Vector3d::Constant(10.0), kGasHu),
                         ellipsoid({0.0, 8.0, 0.0}, Vector3d::Constant(5.0), kCorticalHu)});
  const double expected = 100.0 - 20.0 + 10.0 * 2.0;
  EXPECT_NEAR(all_mm(SolidProjector(phantom, tissue()), {0.0, -400.0, 0.0}, Vector3d::Zero()),
              expected,
              kRootToleranceMm);
}

TEST(SolidProjector, EndsAtTheVolume) {
  const Phantom phantom =
      phantom_of_bodies({elliptic_cylinder(Vector3d::Zero(), {20.0, 300.0, 20.0}, 0)});
  EXPECT_NEAR(all_mm(SolidProjector(phantom, tissue()), {0.0, -400.0, 0.0}, Vector3d::Zero()),
              200.0,
              kRootToleranceMm);
}

TEST(Chords, OfEveryShapeAreWhereTheBodyIs) {
  // Points of a ray every 0.01 mm: a chord is wrong by at most one step at each end, and a gap of
  // a waist that is thinner than 1/24 of the chord may stay unseen.
  constexpr double kStepMm = 0.01;
  HashRandom random(3);
  for (int trial = 0; trial < 300; ++trial) {
    const Solid solid = random_solid(random, trial);
    const Vector3d origin(random.uniform(-6.0, 6.0), -25.0, random.uniform(-6.0, 6.0));
    const Vector3d direction = Vector3d(random.uniform(-0.2, 0.2), 1.0, 0.1).normalized();
    double inside_mm = 0.0;
    for (double t = 0.5 * kStepMm; t < 60.0; t += kStepMm)
      inside_mm += solid.contains(origin + t * direction) ? kStepMm : 0.0;
    double chord_mm = 0.0;
    for (const Chord& chord : chords(solid, origin, direction))
      chord_mm += chord.last_mm - chord.first_mm;
    EXPECT_NEAR(chord_mm, inside_mm, 4.0 * kStepMm + chord_mm * (solid.waist > 0.0 ? 0.05 : 0.0))
        << trial;
  }
}

TEST(Chords, OfAPartOfALineAreThoseOfTheWholeWithinIt) {
  HashRandom random(5);
  int found = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Solid solid = random_solid(random, trial);
    const Vector3d origin(random.uniform(-6.0, 6.0), -25.0, random.uniform(-6.0, 6.0));
    const Vector3d direction = Vector3d(random.uniform(-0.2, 0.2), 1.0, 0.1).normalized();
    const double first_mm = random.uniform(0.0, 50.0);
    const Chord wanted{first_mm, first_mm + random.uniform(1.0, 30.0)};
    const auto within = [&](const Chords& all) {
      std::vector<double> ends_mm;
      for (const Chord& chord : all) {
        const double low = std::max(chord.first_mm, wanted.first_mm);
        const double high = std::min(chord.last_mm, wanted.last_mm);
        if (low < high) ends_mm.insert(ends_mm.end(), {low, high});
      }
      return ends_mm;
    };
    const std::vector<double> whole = within(chords(solid, origin, direction));
    EXPECT_EQ(within(chords(solid, origin, direction, wanted)), whole) << trial;
    found += whole.empty() ? 0 : 1;
  }
  EXPECT_GT(found, 300);
}

TEST(PlaceOf, IsThatOfTheTubesPoints) {
  HashRandom random(9);
  std::array<int, 3> places{};
  for (int trial = 0; trial < 4000; ++trial) {
    const Solid solid = random_solid(random, trial);
    const auto draw = [&](double reach) {
      return Vector3d(random.uniform(-reach, reach),
                      random.uniform(-reach, reach),
                      random.uniform(-reach, reach));
    };
    const Vector3d from = draw(trial % 3 == 0 ? 14.0 : 4.0);
    const Vector3d to = from + draw(4.0);
    const double radius_mm = random.uniform(0.2, 1.5);
    const Place place = place_of(solid, from, to, radius_mm);
    ++places[static_cast<std::size_t>(place)];
    for (int i = 0; i < 50 && place != Place::Near; ++i) {
      const Vector3d aside = random.uniform(0.0, radius_mm) * draw(1.0).normalized();
      const Vector3d point = from + random.uniform() * (to - from) + aside;
      EXPECT_EQ(solid.contains(point), place == Place::Around) << trial;
    }
  }
  for (const int count : places) EXPECT_GT(count, 100);
}

TEST(SolidProjector, GivesARayOfARowWhatItGivesTheRayAlone) {
  const Phantom phantom = make_phantom("spine", true, 4);
  const SmoothMotion motion(phantom.target.box_ct, {}, 7, 8);
  for (const bool moves : {false, true}) {
    const SolidProjector bodies(
        phantom, tissue(), moves ? std::optional(motion) : std::optional<SmoothMotion>());
    for (double z = -150.0; z <= 150.0; z += 60.0) {
      std::vector<Vector3d> points;
      for (double x = -300.0; x <= 300.0; x += 7.0) points.emplace_back(x, 250.0, z);
      std::vector<PathIntegrals> sums(points.size());
      const Vector3d source(40.0, -640.0, 30.0);
      bodies.integrate_row(source, points, sums);
      for (std::size_t i = 0; i < points.size(); ++i) {
        const PathIntegrals alone = bodies.integrate(source, points[i]);
        EXPECT_EQ(sums[i].water_mm, alone.water_mm) << moves << ' ' << z << ' ' << i;
        EXPECT_EQ(sums[i].bone_mm, alone.bone_mm) << moves << ' ' << z << ' ' << i;
      }
    }
  }
}

TEST(SolidProjector, FollowsAMotionThatTheSampledAnatomyHas) {
  // A ball moved by a smooth motion, against its voxels moved by the same one. A voxel of 1 mm
  // places a surface within 0.5 mm (RMS 0.3 mm), pieces of 8 mm add 0.1 mm.
  constexpr double kToleranceMm = 0.8;
  const Phantom phantom = phantom_of_bodies({ellipsoid({10.0, 5.0, -8.0}, {45.0, 40.0, 50.0}, 0)});
  SmoothMotionOptions options;
  options.amplitude_mm = 5.0;
  const SmoothMotion motion({Vector3d::Constant(-5.0), Vector3d::Constant(5.0)}, options, 7, 8);
  const CtVolume ct = motion.moved(sample_phantom(phantom, {1.0, 2, 1, false}));
  const AttenuationVolume volume(ct, AttenuationModel());
  const SiddonProjector sampled(volume, tissue());
  const SolidProjector bodies(phantom, tissue(), motion);
  const SolidProjector still(phantom, tissue());
  double largest_mm = 0.0;
  for (double x = -20.0; x <= 30.0; x += 10.0)
    for (double z = -30.0; z <= 15.0; z += 9.0) {
      const Vector3d source(3.0, -600.0, 10.0);
      const Vector3d through(x, 0.0, z);
      EXPECT_NEAR(all_mm(bodies, source, through), all_mm(sampled, source, through), kToleranceMm);
      largest_mm = std::max(
          largest_mm, std::abs(all_mm(bodies, source, through) - all_mm(still, source, through)));
    }
  EXPECT_GT(largest_mm, 3.0 * kToleranceMm);
}

TEST(SolidProjector, FindsSmallBodiesThatAMotionMovesByMoreThanTheirSize) {
  // Every ray goes through a point where the moved anatomy shows a ball's centre. The oracle
  // samples the ray every 0.01 mm. Pieces of 8 mm miss the motion by 0.06 mm, which at the rim of a
  // ball of 3 mm is a chord of 1.2 mm.
  constexpr double kRadiusMm = 3.0;
  constexpr double kStepMm = 0.01;
  constexpr double kToleranceMm = 1.2 + 2.0 * kStepMm;
  SmoothMotionOptions options;
  options.amplitude_mm = 5.0;
  const SmoothMotion motion({Vector3d::Constant(-5.0), Vector3d::Constant(5.0)}, options, 7, 8);
  const Vector3d source(3.0, -600.0, 10.0);
  int moved_farther_than_its_size = 0;
  for (int i = 0; i < 40; ++i) {
    HashRandom random(1, 2, static_cast<std::uint64_t>(i));
    const auto draw = [&] { return random.uniform(-55.0, 55.0); };
    const Vector3d through(draw(), draw(), draw());
    const Vector3d center = through + motion.displacement_mm(through);
    const Solid ball = ellipsoid(center, Vector3d::Constant(kRadiusMm), 0);
    const SolidProjector bodies(phantom_of_bodies({ball}), tissue(), motion);
    const Vector3d direction = (through - source).normalized();
    double inside_mm = 0.0;
    for (int step = 0; step < 20000; ++step) {
      const Vector3d point = source + (500.0 + kStepMm * step) * direction;
      inside_mm += ball.contains(point + motion.displacement_mm(point)) ? kStepMm : 0.0;
    }
    EXPECT_NEAR(all_mm(bodies, source, through), inside_mm, kToleranceMm) << i;
    EXPECT_GT(inside_mm, kRadiusMm) << i;
    moved_farther_than_its_size += (center - through).norm() > kRadiusMm ? 1 : 0;
  }
  EXPECT_GT(moved_farther_than_its_size, 10);
}

class EveryDrawnPatient : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryDrawnPatient, ShowsInXraysWhatItsCtHolds) {
  // Like EveryPhantom.HasTheLineIntegralsOfItsBodies, but with voxels of 2 mm and with textures.
  // These add 60 HU over 4 mm, some 30 times: 1.3 mm.
  constexpr double kRmsMm = 6.0;
  constexpr double kMeanShare = 0.005;
  const Phantom phantom = make_phantom(GetParam(), false, 4);
  const CtVolume ct = sample_phantom(phantom, {2.0, 2, 0, false});
  const AttenuationVolume volume(ct, AttenuationModel());
  const SiddonProjector sampled(volume, tissue());
  const SolidProjector bodies(phantom, tissue());
  double squares = 0.0;
  double difference = 0.0;
  double reference = 0.0;
  int rays = 0;
  for (double a = -60.0; a <= 60.0; a += 8.0)
    for (double z = -60.0; z <= 60.0; z += 8.0, ++rays) {
      const Vector3d source(620.0, -640.0, 30.0);
      const double exact = all_mm(bodies, source, {a, 0.0, z});
      const double error = all_mm(sampled, source, {a, 0.0, z}) - exact;
      squares += error * error;
      difference += error;
      reference += exact;
    }
  EXPECT_LT(std::sqrt(squares / rays), kRmsMm);
  EXPECT_LT(std::abs(difference / reference), kMeanShare);
}

INSTANTIATE_TEST_SUITE_P(Phantoms,
                         EveryDrawnPatient,
                         ::testing::ValuesIn(phantom_names()),
                         [](const auto& instance) { return instance.param; });

}  // namespace
}  // namespace af
