// SPDX-License-Identifier: Apache-2.0
#include "study/node_volume.h"

#include <cstddef>

#include "base/error.h"
#include "spectrum/bone_volume.h"

namespace af {

std::shared_ptr<const AttenuationVolume> volume_per_node(
    const CtGrid& bordered_grid,
    const AttenuationModel& model,
    VoxelSource source,
    const std::function<void(std::span<std::uint16_t> voxels)>& fill,
    const Communicator& communicator) {
  const std::size_t count = bordered_grid.voxel_count();
  const std::size_t bytes = count * sizeof(std::uint16_t);
  const auto fill_memory = [&](std::span<std::byte> memory) {
    fill({reinterpret_cast<std::uint16_t*>(memory.data()), count});
  };
  const auto owner = source == VoxelSource::Root
                         ? communicator.allocate_on_nodes_from_root(bytes, fill_memory)
                         : communicator.allocate_on_node(bytes, fill_memory);
  const auto* const voxels = reinterpret_cast<const std::uint16_t*>(owner.get());
  return std::make_shared<const AttenuationVolume>(
      bordered_grid, model, SharedArray<std::uint16_t>(owner, {voxels, count}));
}

std::shared_ptr<const AttenuationVolume> bone_per_node(const AttenuationVolume& volume,
                                                       const Communicator& communicator) {
  auto bone = volume_per_node(
      volume.grid(),
      volume.model(),
      VoxelSource::Node,
      [&](std::span<std::uint16_t> voxels) { fill_bone_voxels(volume, voxels); },
      communicator);
  if (!(bone->max_mu_per_mm() > 0.0))
    throw InputError("the CT has no bone: no voxel attenuates more than soft tissue does");
  return bone;
}

}  // namespace af
