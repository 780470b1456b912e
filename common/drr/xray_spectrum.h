// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "base/described_fields.h"
#include "drr/tissue_model.h"

namespace af {

/// Tube and filter.
struct SpectrumOptions {
  double tube_kvp = 100.0;    ///< 0: one energy, the effective energy of the CT's HU scale
  double aluminium_mm = 3.0;  ///< total filtration

  /// The effective energy alone, as in Beer and Lambert's law.
  static SpectrumOptions one_energy();
  [[nodiscard]] bool is_one_energy() const { return tube_kvp == 0.0; }

  void describe(Fields& field);
};

std::vector<std::string> problems(const SpectrumOptions& options);

/// One of the energy bins of equal width between 10 keV and the tube voltage.
struct SpectrumBin {
  double energy_kev;  ///< centre
  double weight;      ///< share of the open beam's detector signal
};

/// Detected spectrum of the open beam; weights sum to 1. It is thick-target bremsstrahlung by
/// Kramers' law (H. A. Kramers, Phil. Mag. 46:836, 1923): photons per keV ~ (kVp - E) / E, filtered
/// by aluminium. An ideal energy-integrating detector weights every photon by E. Characteristic
/// lines and the detector's own absorption are left out.
std::vector<SpectrumBin> tube_spectrum(const SpectrumOptions& options, double effective_energy_kev);

/// Lengths of material along one ray. Water and bone are given as mm of water that attenuate alike
/// at the effective energy.
struct RayMaterials {
  double water_mm = 0.0;
  double bone_mm = 0.0;
  double steel_mm = 0.0;
};

/// Transmission of the whole spectrum through water, bone and steel (as iron).
/// \test BeamTransmission.HardensWithDepth
class BeamTransmission {
 public:
  BeamTransmission(const SpectrumOptions& options, const TissueModel& tissue);

  /// Detector signal relative to the open beam, in (0, 1].
  [[nodiscard]] double transmission(const RayMaterials& materials) const;
  [[nodiscard]] const std::vector<SpectrumBin>& spectrum() const { return spectrum_; }

 private:
  struct Coefficients {
    double water_per_mm;
    double bone_per_mm;
    double steel_per_mm;
  };
  std::vector<SpectrumBin> spectrum_;
  std::vector<Coefficients> coefficients_;  ///< one per bin
};

}  // namespace af
