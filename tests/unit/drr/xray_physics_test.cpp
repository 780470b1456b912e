// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "drr/material_tables.h"
#include "drr/tissue_model.h"
#include "drr/xray_spectrum.h"

namespace af {
namespace {

// exp() and log() of tabulated values: a few units in the last place.
constexpr double kTableTolerance = 1e-14;
// Sums of 40 weights.
constexpr double kSumTolerance = 1e-14;

TEST(MaterialTables, ReproduceNistRowsAndInterpolateLogLog) {
  EXPECT_NEAR(mass_attenuation_cm2_per_g(Material::Water, 60.0), 0.2059, kTableTolerance);
  EXPECT_NEAR(mass_attenuation_cm2_per_g(Material::CorticalBone, 60.0), 0.3148, kTableTolerance);
  EXPECT_NEAR(mass_attenuation_cm2_per_g(Material::Aluminium, 30.0), 1.128, kTableTolerance);
  EXPECT_NEAR(mass_attenuation_cm2_per_g(Material::Iron, 100.0), 0.3717, kTableTolerance);
  EXPECT_NEAR(mass_attenuation_cm2_per_g(Material::Water, 10.0), 5.329, 1e-13);
  EXPECT_NEAR(mass_attenuation_cm2_per_g(Material::Water, 200.0), 0.1370, kTableTolerance);
  // The geometric mean of two energies has the geometric mean of the values.
  EXPECT_NEAR(mass_attenuation_cm2_per_g(Material::CorticalBone, std::sqrt(60.0 * 80.0)),
              std::sqrt(0.3148 * 0.2229),
              kTableTolerance);
}

TEST(MaterialTables, AttenuationFallsWithEnergy) {
  for (const Material material :
       {Material::Water, Material::CorticalBone, Material::Aluminium, Material::Iron})
    for (double energy = 10.0; energy < 199.0; energy += 1.0)
      EXPECT_GT(linear_attenuation_per_mm(material, energy),
                linear_attenuation_per_mm(material, energy + 1.0));
}

TEST(MaterialTables, RefuseEnergiesOutsideTheTables) {
  EXPECT_THROW(mass_attenuation_cm2_per_g(Material::Water, 9.99), InputError);
  EXPECT_THROW(mass_attenuation_cm2_per_g(Material::Water, 200.01), InputError);
  EXPECT_THROW(mass_attenuation_cm2_per_g(Material::Water, std::nan("")), InputError);
}

TEST(MaterialTables, EffectiveEnergyInvertsWatersAttenuation) {
  // One unit in the last place of the energy changes mu by less than 1e-15 relative.
  constexpr double kTolerance = 1e-15;
  EXPECT_NEAR(
      linear_attenuation_per_mm(Material::Water, effective_energy_kev(0.0200)), 0.0200, kTolerance);
  // 0.02059/mm is tabulated at 60 keV, 0.01837/mm at 80 keV.
  EXPECT_GT(effective_energy_kev(0.0200), 60.0);
  EXPECT_LT(effective_energy_kev(0.0200), 80.0);
  EXPECT_THROW(effective_energy_kev(0.6), InputError);
  EXPECT_THROW(effective_energy_kev(0.01), InputError);
}

TEST(TissueModel, BoneIsZeroForSoftTissueAndEverythingAboveCorticalBone) {
  const TissueModel tissue{AttenuationModel{}};
  EXPECT_EQ(tissue.bone_part(1000), 0.0f);
  EXPECT_EQ(tissue.bone_part(1100), 0.0f);
  EXPECT_GT(tissue.bone_part(1101), 0.0f);
  EXPECT_EQ(tissue.bone_part(4000), 4000.0f);
  for (std::uint16_t relative = 1100; relative < 4000; ++relative) {
    EXPECT_LE(tissue.bone_part(relative), static_cast<float>(relative));
    EXPECT_LT(tissue.bone_part(relative),
              tissue.bone_part(static_cast<std::uint16_t>(relative + 1)));
  }
}

TEST(TissueModel, PureCorticalBoneAttenuatesAsTheTableAtEveryEnergy) {
  const TissueModel tissue{AttenuationModel{}};
  const double relative = 1.0 + tissue.cortical_bone_hu() / 1000.0;
  for (const double energy : {30.0, 50.0, 80.0, 120.0})
    EXPECT_NEAR(relative * tissue.bone_mu_per_mm(energy),
                linear_attenuation_per_mm(Material::CorticalBone, energy),
                kTableTolerance);
}

TEST(TubeSpectrum, IsNormalisedPositiveAndEndsAtTheTubeVoltage) {
  const SpectrumOptions options;
  const std::vector<SpectrumBin> bins = tube_spectrum(options, 65.0);
  ASSERT_GE(bins.size(), 20u);
  double sum = 0.0;
  for (const SpectrumBin& bin : bins) {
    EXPECT_GT(bin.weight, 0.0);
    EXPECT_LT(bin.energy_kev, options.tube_kvp);
    sum += bin.weight;
  }
  EXPECT_NEAR(sum, 1.0, kSumTolerance);
}

TEST(TubeSpectrum, FollowsKramersLawWithoutFilter) {
  SpectrumOptions options;
  options.aluminium_mm = 0.0;
  // Energy weighting turns (kVp - E) / E into kVp - E: a straight line.
  const std::vector<SpectrumBin> bins = tube_spectrum(options, 65.0);
  const double ratio = bins.front().weight / (options.tube_kvp - bins.front().energy_kev);
  for (const SpectrumBin& bin : bins)
    EXPECT_NEAR(bin.weight, ratio * (options.tube_kvp - bin.energy_kev), kSumTolerance);
}

TEST(TubeSpectrum, FilterRaisesTheMeanEnergy) {
  const auto mean_energy = [](double aluminium_mm) {
    double sum = 0.0;
    for (const SpectrumBin& bin : tube_spectrum({100.0, aluminium_mm}, 65.0))
      sum += bin.weight * bin.energy_kev;
    return sum;
  };
  EXPECT_GT(mean_energy(3.0), mean_energy(0.0) + 5.0);
  EXPECT_GT(mean_energy(10.0), mean_energy(3.0));
}

TEST(SpectrumOptions, ReportsEveryBrokenConstraint) {
  EXPECT_TRUE(problems(SpectrumOptions{}).empty());
  EXPECT_THAT(problems(SpectrumOptions{500.0, -1.0}),
              ::testing::ElementsAre(::testing::HasSubstr("tube_kvp = 500"),
                                     ::testing::HasSubstr("aluminium_mm = -1")));
}

TEST(BeamTransmission, HardensWithDepth) {
  const TissueModel tissue{AttenuationModel{}};
  const BeamTransmission beam(SpectrumOptions{}, tissue);
  double previous = std::numeric_limits<double>::infinity();
  for (double depth = 5.0; depth <= 300.0; depth += 5.0) {
    const double effective_mu = -std::log(beam.transmission({depth, 0.0, 0.0})) / depth;
    EXPECT_LT(effective_mu, previous) << depth << " mm of water";
    previous = effective_mu;
  }
  EXPECT_NEAR(beam.transmission({}), 1.0, kSumTolerance);
}

TEST(BeamTransmission, IsExponentialAtOneEnergy) {
  const TissueModel tissue{AttenuationModel{}};
  SpectrumOptions options;
  options.tube_kvp = 0.0;
  const BeamTransmission beam(options, tissue);
  // At the effective energy water and bone integrals count alike.
  EXPECT_NEAR(-std::log(beam.transmission({70.0, 30.0, 0.0})), 0.0200 * 100.0, 1e-13);
}

TEST(BeamTransmission, TwoMillimetresOfSteelStopMoreThanSoftTissueWould) {
  const TissueModel tissue{AttenuationModel{}};
  const BeamTransmission beam(SpectrumOptions{}, tissue);
  // Behind 150 mm of water the mean energy is above 50 keV and below 100 keV, where 2 mm of iron
  // have exp(-3.08) and exp(-0.585).
  const double factor = beam.transmission({150.0, 0.0, 2.0}) / beam.transmission({150.0, 0.0, 0.0});
  EXPECT_GT(factor, std::exp(-0.2 * 1.958 * 7.874));
  EXPECT_LT(factor, std::exp(-0.2 * 0.3717 * 7.874));
}

}  // namespace
}  // namespace af
