// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "ct/attenuation_volume.h"
#include "ct/ct_facts.h"
#include "ct/ct_reader.h"
#include "ranks/communicator.h"
#include "study/study_file.h"

namespace af {

/// The attenuation of a CT, held once per node.
struct NodeCt {
  std::shared_ptr<const AttenuationVolume> volume;
  CtFacts facts;
};

/// The CT of a case. Throws as read_ct(), with the study's line, and as require_target_in_ct().
CtVolume read_case_ct(const StudyCase& study_case, std::vector<std::string>* warnings = nullptr);

/// Collective. Rank 0 reads the CT, and the other nodes get the voxels. Throws as read_ct(), on
/// every rank. Ranks hold only the voxels that their node shares. Rank 0 also holds the file's
/// values and the CT as int16 while it reads, then the CT while it fills the voxels.
NodeCt read_ct_per_node(const std::filesystem::path& path,
                        const CtReadOptions& options,
                        const AttenuationModel& model,
                        const Communicator& communicator,
                        std::vector<std::string>& warnings);

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
/// Throws InputError when there is none.
std::shared_ptr<const AttenuationVolume> bone_per_node(const AttenuationVolume& volume,
                                                       const Communicator& communicator);

}  // namespace af
