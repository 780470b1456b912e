// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "ct/attenuation_volume.h"

namespace af {

/// How a CT value becomes attenuation at every energy. Each voxel is a mixture by volume of soft
/// tissue (water of density 1 + soft_tissue_hu/1000) and cortical bone (ICRU-44), so that HU is
/// linear in the bone's share. Values at or below soft_tissue_hu are water of varying density, and
/// values above cortical bone's own HU are bone of higher density. At the effective energy of the
/// HU scale both parts add up to exactly mu_water * max(0, 1 + HU/1000). Two materials follow
/// Joseph and Spital (J. Comput. Assist. Tomogr. 2:100, 1978); the linear transition in place of
/// their threshold is this project's choice.
class TissueModel {
 public:
  /// `relative` is in units of mu_water/1000, as AttenuationVolume stores it. Throws InputError
  /// when the model's mu_water fits no X-ray energy.
  explicit TissueModel(const AttenuationModel& model, int soft_tissue_hu = 100);

  /// The part of a voxel's relative attenuation (units of mu_water/1000) that is bone, at the
  /// effective energy; the rest is water.
  [[nodiscard]] float bone_part(std::uint16_t relative) const { return bone_parts_[relative]; }
  [[nodiscard]] const AttenuationModel& attenuation_model() const { return model_; }
  [[nodiscard]] double effective_energy_kev() const { return effective_energy_kev_; }
  /// The HU of ICRU-44 cortical bone (1.92 g/cm^3) at the effective energy.
  [[nodiscard]] double cortical_bone_hu() const { return cortical_bone_hu_; }
  /// mu_water(E) and mu_bone(E) (1/mm) of tissue whose mu at the effective energy is the model's
  /// mu_water.
  [[nodiscard]] double water_mu_per_mm(double energy_kev) const;
  [[nodiscard]] double bone_mu_per_mm(double energy_kev) const;

 private:
  AttenuationModel model_;
  double effective_energy_kev_;
  double cortical_bone_hu_;
  std::vector<float> bone_parts_;  ///< one per uint16 value
};

}  // namespace af
