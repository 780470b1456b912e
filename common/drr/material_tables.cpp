// SPDX-License-Identifier: Apache-2.0
#include "drr/material_tables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"

namespace af {

namespace {

constexpr std::size_t kEnergyCount = 11;

constexpr std::array<double, kEnergyCount> kEnergiesKev = {
    10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 150.0, 200.0};

struct MaterialData {
  double density_g_per_cm3;
  std::array<double, kEnergyCount> mass_attenuation_cm2_per_g;
};

constexpr MaterialData kWater = {
    1.000, {5.329, 1.673, 0.8096, 0.3756, 0.2683, 0.2269, 0.2059, 0.1837, 0.1707, 0.1505, 0.1370}};
constexpr MaterialData kCorticalBone = {
    1.920, {28.51, 9.032, 4.001, 1.331, 0.6655, 0.4242, 0.3148, 0.2229, 0.1855, 0.1480, 0.1309}};
constexpr MaterialData kAluminium = {
    2.699, {26.23, 7.955, 3.441, 1.128, 0.5685, 0.3681, 0.2778, 0.2018, 0.1704, 0.1378, 0.1223}};
constexpr MaterialData kIron = {
    7.874, {170.6, 57.08, 25.68, 8.176, 3.629, 1.958, 1.205, 0.5952, 0.3717, 0.1964, 0.1460}};

const MaterialData& data_of(Material material) {
  switch (material) {
    case Material::CorticalBone:
      return kCorticalBone;
    case Material::Aluminium:
      return kAluminium;
    case Material::Iron:
      return kIron;
    case Material::Water:
      break;
  }
  return kWater;
}

}  // namespace

double mass_attenuation_cm2_per_g(Material material, double energy_kev) {
  if (!(energy_kev >= kLowestTableEnergyKev && energy_kev <= kHighestTableEnergyKev))
    throw InputError("photon energy",
                     std::to_string(energy_kev) + " keV",
                     "the attenuation tables reach from 10 to 200 keV");
  const auto& values = data_of(material).mass_attenuation_cm2_per_g;
  const auto above = std::upper_bound(kEnergiesKev.begin() + 1, kEnergiesKev.end() - 1, energy_kev);
  const auto high = static_cast<std::size_t>(above - kEnergiesKev.begin());
  const std::size_t low = high - 1;
  const double fraction =
      std::log(energy_kev / kEnergiesKev[low]) / std::log(kEnergiesKev[high] / kEnergiesKev[low]);
  return values[low] * std::pow(values[high] / values[low], fraction);
}

double density_g_per_cm3(Material material) {
  return data_of(material).density_g_per_cm3;
}

double linear_attenuation_per_mm(Material material, double energy_kev) {
  constexpr double kMmPerCm = 10.0;
  return mass_attenuation_cm2_per_g(material, energy_kev) * density_g_per_cm3(material) / kMmPerCm;
}

double effective_energy_kev(double mu_water_per_mm) {
  double low = kLowestTableEnergyKev;  // water attenuates less as energy grows to 200 keV
  double high = kHighestTableEnergyKev;
  const double largest = linear_attenuation_per_mm(Material::Water, low);
  const double smallest = linear_attenuation_per_mm(Material::Water, high);
  if (!(mu_water_per_mm >= smallest && mu_water_per_mm <= largest))
    throw InputError(
        "water_mu_per_mm",
        std::to_string(mu_water_per_mm),
        "must be water's attenuation at some energy of 10 to 200 keV, that is between " +
            std::to_string(smallest) + " and " + std::to_string(largest));
  constexpr int kBisections = 60;  // 190 keV / 2^60 is below one unit in the last place
  for (int i = 0; i < kBisections; ++i) {
    const double middle = 0.5 * (low + high);
    (linear_attenuation_per_mm(Material::Water, middle) > mu_water_per_mm ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace af
