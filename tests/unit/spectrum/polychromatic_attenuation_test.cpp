// SPDX-License-Identifier: Apache-2.0
#include "spectrum/polychromatic_attenuation.h"

#include <cmath>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "base/hash_random.h"

namespace af {
namespace {

// exp() and log() of sums of 40 terms of order 1.
constexpr double kExactTolerance = 1e-13;

const TissueModel& usual_tissue() {
  static const TissueModel tissue{AttenuationModel{}};
  return tissue;
}

/// Tube voltage and filter.
class PolychromaticAttenuationOf : public testing::TestWithParam<std::tuple<double, double>> {
 protected:
  SpectrumOptions options_{std::get<0>(GetParam()), std::get<1>(GetParam()), 40};
  PolychromaticAttenuation attenuation_{options_, usual_tissue()};
};

TEST_P(PolychromaticAttenuationOf, ATubeIsTheSumOverItsSpectrum) {
  const BeamTransmission beam(options_, usual_tissue());
  const double mu_water = usual_tissue().attenuation_model().mu_water_per_mm;
  for (const double water_mm : {0.0, 1.0, 40.0, 300.0})
    for (const double bone_mm : {0.0, 0.5, 30.0, 120.0})
      EXPECT_NEAR(
          attenuation_.exactly(mu_water * (water_mm + bone_mm), mu_water * bone_mm).attenuation,
          -std::log(beam.transmission({water_mm, bone_mm, 0.0})),
          kExactTolerance * 100.0);
}

TEST_P(PolychromaticAttenuationOf, ATubeIsWithinItsToleranceOfTheSum) {
  HashRandom random(7);
  for (int i = 0; i < 20000; ++i) {
    // A third of the rays in the thin layers, where the beam hardens fastest.
    const double reach = i % 3 == 0 ? 0.5 : 18.0;
    const double water = reach * random.uniform();
    const double bone = reach * random.uniform();
    const auto found = attenuation_.at(water + bone, bone);
    const auto expected = attenuation_.exactly(water + bone, bone);
    ASSERT_NEAR(found.attenuation, expected.attenuation, PolychromaticAttenuation::kTolerance)
        << water << " of water, " << bone << " of bone";
    // A slope's error is the value's over a fraction of a cell.
    constexpr double kSlopeTolerance = 5e-3;
    ASSERT_NEAR(found.by_all, expected.by_all, kSlopeTolerance * expected.by_all);
    ASSERT_NEAR(found.by_bone, expected.by_bone, kSlopeTolerance * expected.by_all);
  }
}

TEST_P(PolychromaticAttenuationOf, ATubeHasItsOwnSlopes) {
  constexpr double kStep = 1e-5;
  HashRandom random(8);
  for (int i = 0; i < 1000; ++i) {
    const double bone = 0.01 + 5.0 * random.uniform();
    const double all = bone + 0.01 + 8.0 * random.uniform();
    const auto value = attenuation_.at(all, bone);
    const double by_all = (attenuation_.at(all + kStep, bone).attenuation -
                           attenuation_.at(all - kStep, bone).attenuation) /
                          (2.0 * kStep);
    const double by_bone = (attenuation_.at(all, bone + kStep).attenuation -
                            attenuation_.at(all, bone - kStep).attenuation) /
                           (2.0 * kStep);
    // Second derivatives jump between cells: half a step of such a jump.
    constexpr double kDifferenceTolerance = 1e-4;
    ASSERT_NEAR(value.by_all, by_all, kDifferenceTolerance);
    ASSERT_NEAR(value.by_bone, by_bone, kDifferenceTolerance);
  }
}

INSTANTIATE_TEST_SUITE_P(Tubes,
                         PolychromaticAttenuationOf,
                         testing::Combine(testing::Values(30.0, 60.0, 100.0, 150.0, 200.0),
                                          testing::Values(0.0, 3.0, 25.0)));

TEST(PolychromaticAttenuation, OfOneEnergyIsTheLinearModel) {
  const PolychromaticAttenuation attenuation(SpectrumOptions::one_energy(), usual_tissue());
  for (const double all : {-0.3, 0.0, 0.01, 2.5, 15.0, 40.0})
    for (const double share : {0.0, 0.3, 1.0}) {
      const auto value = attenuation.at(all, share * all);
      EXPECT_NEAR(value.attenuation, all, 1e-6);  // nodes are rounded to single precision
      EXPECT_NEAR(value.by_all, 1.0, 1e-4);
      EXPECT_NEAR(value.by_bone, 0.0, 1e-4);
    }
}

TEST(PolychromaticAttenuation, HardensTheBeamAndCountsBoneLessThanItsHu) {
  const PolychromaticAttenuation attenuation(SpectrumOptions{}, usual_tissue());
  // Slope by water falls with depth.
  double previous = 2.0;
  for (double all = 0.1; all < 12.0; all += 0.1) {
    const double slope = attenuation.at(all, 0.0).by_all;
    EXPECT_LT(slope, previous);
    previous = slope;
  }
  // A soft beam: bone's photoelectric absorption counts for more than at the effective energy,
  // behind much water for less than before it.
  EXPECT_GT(attenuation.at(0.5, 0.5).attenuation, attenuation.at(0.5, 0.0).attenuation);
  EXPECT_LT(attenuation.at(6.0, 0.5).by_bone, attenuation.at(0.5, 0.5).by_bone);
}

TEST(PolychromaticAttenuation, CutsNoiseOffContinuously) {
  const PolychromaticAttenuation attenuation(SpectrumOptions{}, usual_tissue());
  EXPECT_EQ(attenuation.at(0.0, 0.0).attenuation, 0.0);
  EXPECT_EQ(attenuation.at(0.0, 0.2).attenuation, 0.0);
  EXPECT_EQ(attenuation.at(2.0, -0.1).attenuation, attenuation.at(2.0, 0.0).attenuation);
  EXPECT_EQ(attenuation.at(2.0, 2.1).attenuation, attenuation.at(2.0, 2.0).attenuation);
  EXPECT_LT(attenuation.at(-0.01, 0.0).attenuation, 0.0);
  EXPECT_EQ(attenuation.at(2.0, -0.1).by_bone, 0.0);
}

TEST(PolychromaticAttenuation, IsFiniteForEveryLength) {
  const PolychromaticAttenuation attenuation(SpectrumOptions{}, usual_tissue());
  for (const double all : {1e2, 1e3, 1e5}) {
    const auto value = attenuation.at(all, 0.4 * all);
    EXPECT_TRUE(std::isfinite(value.attenuation) && value.attenuation > 0.5 * all);
    EXPECT_TRUE(std::isfinite(value.by_all) && std::isfinite(value.by_bone));
  }
}

}  // namespace
}  // namespace af
