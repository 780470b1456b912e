// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "parallel/communicator.h"
#include "volume/attenuation_volume.h"

namespace af {

/// Who fills the voxels of a node: its own first rank, or rank 0 of all, from which they are
/// copied.
enum class VoxelSource { Node, Root };

/// Collective. A volume held once per node. An exception in `fill` is thrown on every rank.
std::shared_ptr<const AttenuationVolume> volume_per_node(
    const CtGrid& bordered_grid,
    const AttenuationModel& model,
    VoxelSource source,
    const std::function<void(std::span<std::uint16_t> voxels)>& fill,
    const Communicator& communicator);

/// Collective. The part of a CT's attenuation that is bone (bone_volume()), held once per node.
/// InputError when there is none.
std::shared_ptr<const AttenuationVolume> bone_per_node(const AttenuationVolume& volume,
                                                       const Communicator& communicator);

}  // namespace af
