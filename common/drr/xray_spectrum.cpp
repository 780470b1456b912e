// SPDX-License-Identifier: Apache-2.0
#include "drr/xray_spectrum.h"

#include <cmath>

#include "drr/material_tables.h"

namespace af {

namespace {
constexpr int kEnergyBins = 40;
}  // namespace

SpectrumOptions SpectrumOptions::one_energy() {
  SpectrumOptions options;
  options.tube_kvp = 0.0;
  return options;
}

void SpectrumOptions::describe(Fields& field) {
  field("tube_kvp", tube_kvp, "Tube voltage, kV; 0: only the HU scale's effective energy")
      .such_that("between 30 and 200, or 0 for a single energy", [](double kvp) {
        return kvp == 0.0 || (kvp >= 30.0 && kvp <= kHighestTableEnergyKev);
      });
  field("aluminium_mm", aluminium_mm, "Filtration, mm of aluminium").within(0.0, 50.0);
}

std::vector<std::string> problems(const SpectrumOptions& options) {
  return field_problems(options);
}

std::vector<SpectrumBin> tube_spectrum(const SpectrumOptions& options,
                                       double effective_energy_kev) {
  if (options.is_one_energy()) return {{effective_energy_kev, 1.0}};
  std::vector<SpectrumBin> bins;
  const double width_kev = (options.tube_kvp - kLowestTableEnergyKev) / kEnergyBins;
  double sum = 0.0;
  for (int i = 0; i < kEnergyBins; ++i) {
    const double energy_kev = kLowestTableEnergyKev + (i + 0.5) * width_kev;
    const double photons = (options.tube_kvp - energy_kev) / energy_kev;
    const double filtered =
        photons * std::exp(-options.aluminium_mm *
                           linear_attenuation_per_mm(Material::Aluminium, energy_kev));
    bins.push_back({energy_kev, filtered * energy_kev});
    sum += bins.back().weight;
  }
  for (SpectrumBin& bin : bins) bin.weight /= sum;
  return bins;
}

BeamTransmission::BeamTransmission(const SpectrumOptions& options, const TissueModel& tissue)
    : spectrum_(tube_spectrum(options, tissue.effective_energy_kev())) {
  for (const SpectrumBin& bin : spectrum_)
    coefficients_.push_back({tissue.water_mu_per_mm(bin.energy_kev),
                             tissue.bone_mu_per_mm(bin.energy_kev),
                             linear_attenuation_per_mm(Material::Iron, bin.energy_kev)});
}

double BeamTransmission::transmission(const RayMaterials& materials) const {
  double signal = 0.0;
  for (std::size_t i = 0; i < spectrum_.size(); ++i)
    signal += spectrum_[i].weight * std::exp(-(coefficients_[i].water_per_mm * materials.water_mm +
                                               coefficients_[i].bone_per_mm * materials.bone_mm +
                                               coefficients_[i].steel_per_mm * materials.steel_mm));
  return signal;
}

}  // namespace af
