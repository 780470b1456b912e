// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace af {

/// Materials of the X-ray simulation.
enum class Material { Water, CorticalBone, Aluminium, Iron };

/// Photon energies (keV) that the tables cover.
inline constexpr double kLowestTableEnergyKev = 10.0;
inline constexpr double kHighestTableEnergyKev = 200.0;

/// Mass attenuation coefficient mu/rho (cm^2/g) with coherent scattering, from J. H. Hubbell and S.
/// M. Seltzer, NIST Standard Reference Database 126 (NISTIR 5632), tables 3 (Al, Fe) and 4 (liquid
/// water; cortical bone after ICRU-44). It is interpolated log-log between the tabulated energies;
/// no listed edge lies within the range. Throws InputError outside it.
/// \test MaterialTables.ReproduceNistRowsAndInterpolateLogLog
double mass_attenuation_cm2_per_g(Material material, double energy_kev);

/// Density (g/cm^3) that NIST's tables 1 and 2 state for the material.
double density_g_per_cm3(Material material);

/// Linear attenuation coefficient (1/mm) at that density.
double linear_attenuation_per_mm(Material material, double energy_kev);

/// The energy (keV) at which water attenuates with `mu_water_per_mm`. It is the effective energy of
/// a CT whose HU scale has that constant. Throws InputError when the tables have no such energy.
double effective_energy_kev(double mu_water_per_mm);

}  // namespace af
