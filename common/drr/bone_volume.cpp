// SPDX-License-Identifier: Apache-2.0
#include "drr/bone_volume.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "drr/tissue_model.h"

namespace af {

void fill_bone_voxels(const AttenuationVolume& volume, std::span<std::uint16_t> voxels) {
  const std::span<const std::uint16_t> all = volume.voxels();
  check(voxels.size() == all.size(), "one voxel per voxel of the volume");
  const TissueModel tissue(volume.model());
  std::transform(all.begin(), all.end(), voxels.begin(), [&](std::uint16_t relative) {
    return static_cast<std::uint16_t>(std::lround(tissue.bone_part(relative)));
  });
}

std::shared_ptr<const AttenuationVolume> bone_volume(const AttenuationVolume& volume) {
  std::vector<std::uint16_t> voxels(volume.voxels().size());
  fill_bone_voxels(volume, voxels);
  return std::make_shared<const AttenuationVolume>(
      volume.grid(), volume.model(), SharedArray<std::uint16_t>(std::move(voxels)));
}

}  // namespace af
