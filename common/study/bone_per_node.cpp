// SPDX-License-Identifier: Apache-2.0
#include "study/bone_per_node.h"

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.h"
#include "spectrum/bone_volume.h"

namespace af {

std::shared_ptr<const AttenuationVolume> bone_per_node(const AttenuationVolume& volume,
                                                       const Communicator& communicator) {
  const std::size_t count = volume.voxels().size();
  const auto owner = communicator.allocate_on_node(
      count * sizeof(std::uint16_t), [&](std::span<std::byte> memory) {
        fill_bone_voxels(volume, {reinterpret_cast<std::uint16_t*>(memory.data()), count});
      });
  const auto* const voxels = reinterpret_cast<const std::uint16_t*>(owner.get());
  auto bone = std::make_shared<const AttenuationVolume>(
      volume.grid(), volume.model(), SharedArray<std::uint16_t>(owner, {voxels, count}));
  if (!(bone->max_mu_per_mm() > 0.0))
    throw InputError("the CT has no bone: no voxel attenuates more than soft tissue does");
  return bone;
}

}  // namespace af
