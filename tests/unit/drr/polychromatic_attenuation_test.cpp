// SPDX-License-Identifier: Apache-2.0
#include "drr/polychromatic_attenuation.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "base/vector_width.h"

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
  SpectrumOptions options_{std::get<0>(GetParam()), std::get<1>(GetParam())};
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
  const auto [kvp, aluminium_mm] = GetParam();
  const double tolerance = kvp >= 60.0 && aluminium_mm >= 1.0
                               ? PolychromaticAttenuation::kTolerance
                               : PolychromaticAttenuation::kToleranceOfSoftBeams;
  HashRandom random(7);
  for (int i = 0; i < 20000; ++i) {
    // A third of the rays in the thin layers, where the beam hardens fastest.
    const double share = i % 3 == 0 ? 0.04 : 1.0;
    const double water = 12.0 * share * random.uniform();
    const double bone = 8.0 * share * random.uniform();
    const auto found = attenuation_.at(water + bone, bone);
    const auto expected = attenuation_.exactly(water + bone, bone);
    ASSERT_NEAR(found.attenuation,
                expected.attenuation,
                tolerance * std::max(1.0, expected.attenuation / 8.0))
        << water << " of water, " << bone << " of bone";
  }
}

TEST_P(PolychromaticAttenuationOf, ATubeHasItsOwnSlopes) {
  constexpr double kStep = 1.0 / 64.0;
  HashRandom random(8);
  for (int i = 0; i < 1000; ++i) {
    const double bone = 0.5 + 5.0 * random.uniform();
    const double all = bone + 0.5 + 8.0 * random.uniform();
    const auto value = attenuation_.at(all, bone);
    const double by_all = (attenuation_.at(all + kStep, bone).attenuation -
                           attenuation_.at(all - kStep, bone).attenuation) /
                          (2.0 * kStep);
    const double by_bone = (attenuation_.at(all, bone + kStep).attenuation -
                            attenuation_.at(all, bone - kStep).attenuation) /
                           (2.0 * kStep);
    // Both values differ by some dozen roundings to 24 bits; third derivatives are below 1.
    const double tolerance = 2e-6 * (4.0 + value.attenuation) / kStep + kStep * kStep / 6.0;
    ASSERT_NEAR(value.by_all, by_all, tolerance) << all << ' ' << bone;
    ASSERT_NEAR(value.by_bone, by_bone, tolerance) << all << ' ' << bone;
  }
}

INSTANTIATE_TEST_SUITE_P(Tubes,
                         PolychromaticAttenuationOf,
                         testing::Combine(testing::Values(30.0, 60.0, 100.0, 150.0, 200.0),
                                          testing::Values(0.0, 3.0, 25.0)));

/// Rays of every kind: air, noise below 0, bone beyond all, and rays that no polynomial reaches.
struct Rays {
  std::vector<float> all, bone, all_slopes, bone_slopes;
  static constexpr std::size_t kPlanes = 6;

  explicit Rays(std::size_t count) {
    HashRandom random(9);
    for (std::size_t i = 0; i < count; ++i) {
      const double length = i % 7 == 0 ? 40.0 : 10.0;
      all.push_back(static_cast<float>(std::max(-0.2, length * random.uniform() - 2.0)));
      bone.push_back(
          static_cast<float>(1.3 * static_cast<double>(all.back()) * random.uniform() - 0.1));
      if (i / 64 % 3 == 0) all.back() = 0.0f;
    }
    for (std::size_t i = 0; i < kPlanes * count; ++i) {
      all_slopes.push_back(static_cast<float>(random.uniform()));
      bone_slopes.push_back(static_cast<float>(random.uniform()));
    }
  }
};

TEST(PolychromaticAttenuation, HasTheSameBitsAtEveryVectorWidthAndWithSlopes) {
  const PolychromaticAttenuation attenuation(SpectrumOptions{}, usual_tissue());
  const Rays rays(1003);
  std::vector<std::vector<float>> values;
  std::vector<std::vector<float>> slopes;
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    Rays applied = rays;
    attenuation.apply(applied.all, applied.bone, applied.all_slopes, applied.bone_slopes);
    values.push_back(applied.all);
    slopes.push_back(applied.all_slopes);
    applied = rays;
    attenuation.apply(applied.all, applied.bone);
    values.push_back(applied.all);
    // A ray's bits do not depend on its neighbours.
    for (std::size_t i = 0; i < rays.all.size(); ++i)
      ASSERT_EQ(attenuation.at(static_cast<double>(rays.all[i]), static_cast<double>(rays.bone[i]))
                    .attenuation,
                static_cast<double>(values.front()[i]));
    force_vector_width({});
  }
  EXPECT_THAT(values, testing::Each(values.front()));
  EXPECT_THAT(slopes, testing::Each(slopes.front()));
}

TEST(PolychromaticAttenuation, AppliesTheChainRule) {
  const PolychromaticAttenuation attenuation(SpectrumOptions{}, usual_tissue());
  const Rays rays(77);
  Rays applied = rays;
  attenuation.apply(applied.all, applied.bone, applied.all_slopes, applied.bone_slopes);
  for (std::size_t i = 0; i < applied.all_slopes.size(); ++i) {
    const std::size_t ray = i % rays.all.size();
    const auto value =
        attenuation.at(static_cast<double>(rays.all[ray]), static_cast<double>(rays.bone[ray]));
    EXPECT_FLOAT_EQ(applied.all_slopes[i],
                    static_cast<float>(value.by_all) * rays.all_slopes[i] +
                        static_cast<float>(value.by_bone) * rays.bone_slopes[i]);
  }
}

TEST(PolychromaticAttenuation, OfOneEnergyIsTheLinearModel) {
  const PolychromaticAttenuation attenuation(SpectrumOptions::one_energy(), usual_tissue());
  for (const double all : {-0.3, 0.0, 0.01, 2.5, 15.0, 40.0})
    for (const double share : {0.0, 0.3, 1.0}) {
      const auto value = attenuation.at(all, share * all);
      // Coefficients on a grid of 4e-6, a few roundings of values.
      EXPECT_NEAR(value.attenuation, all, 1e-5 + 1e-6 * all);
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
  EXPECT_NEAR(attenuation.at(1e-7, 0.0).attenuation, 0.0, 1e-6);
  // Beyond the reach it goes on straight.
  for (const double all : {12.0, 100.0})
    EXPECT_NEAR(attenuation.at(all * (1.0 + 1e-6), 0.0).attenuation,
                attenuation.at(all, 0.0).attenuation,
                3e-6 * all);
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
