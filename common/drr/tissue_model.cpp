// SPDX-License-Identifier: Apache-2.0
#include "drr/tissue_model.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "drr/material_tables.h"

namespace af {

TissueModel::TissueModel(const AttenuationModel& model, int soft_tissue_hu)
    : model_(model), effective_energy_kev_(af::effective_energy_kev(model.mu_water_per_mm)) {
  const double bone_per_mm =
      linear_attenuation_per_mm(Material::CorticalBone, effective_energy_kev_);
  cortical_bone_hu_ = 1000.0 * (bone_per_mm / model.mu_water_per_mm - 1.0);
  if (!(soft_tissue_hu < cortical_bone_hu_))
    throw InputError("soft_tissue_hu",
                     std::to_string(soft_tissue_hu),
                     "must be below cortical bone's " + std::to_string(cortical_bone_hu_) + " HU");
  bone_parts_.resize(std::size_t{std::numeric_limits<std::uint16_t>::max()} + 1);
  for (std::size_t relative = 0; relative < bone_parts_.size(); ++relative) {
    const double hu = static_cast<double>(relative) - 1000.0;
    const double bone_share =
        std::clamp((hu - soft_tissue_hu) / (cortical_bone_hu_ - soft_tissue_hu), 0.0, 1.0);
    const double bone_relative = std::max(cortical_bone_hu_ + 1000.0, hu + 1000.0);
    bone_parts_[relative] = static_cast<float>(bone_share * bone_relative);
  }
}

double TissueModel::water_mu_per_mm(double energy_kev) const {
  return model_.mu_water_per_mm * linear_attenuation_per_mm(Material::Water, energy_kev) /
         linear_attenuation_per_mm(Material::Water, effective_energy_kev_);
}

double TissueModel::bone_mu_per_mm(double energy_kev) const {
  return model_.mu_water_per_mm * linear_attenuation_per_mm(Material::CorticalBone, energy_kev) /
         linear_attenuation_per_mm(Material::CorticalBone, effective_energy_kev_);
}

}  // namespace af
