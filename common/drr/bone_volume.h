// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "ct/attenuation_volume.h"

namespace af {

/// Writes the part of every voxel's attenuation that is bone into memory laid out as the volume's
/// voxels (TissueModel::bone_part(), rounded to the volume's units of mu_water/1000). Voxels are
/// split before anything is interpolated or blurred, so the line integrals of the rest are water's.
void fill_bone_voxels(const AttenuationVolume& volume, std::span<std::uint16_t> voxels);

/// A volume of those voxels on the same grid, in memory of this process.
/// \test BoneVolume.HoldsTheBonePartOfEveryVoxel
std::shared_ptr<const AttenuationVolume> bone_volume(const AttenuationVolume& volume);

}  // namespace af
