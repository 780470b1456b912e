// SPDX-License-Identifier: Apache-2.0
#include "study/node_ct.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>

#include "base/error.h"
#include "drr/bone_volume.h"
#include "ranks/root_only.h"
#include "study/target_place.h"

namespace af {

namespace {

/// What rank 0 tells the others about the CT that it reads.
struct FoundInCt {
  CtFacts facts;
  CtGrid bordered;  ///< of its attenuation

  auto members() {
    return std::tuple_cat(
        facts.members(),
        std::tie(bordered.size, bordered.origin_mm, bordered.spacing_mm, bordered.direction));
  }
};

}  // namespace

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

CtVolume read_case_ct(const StudyCase& study_case, std::vector<std::string>* warnings) {
  CtVolume ct = naming_study_line(study_case.places, "ct", [&] {
    return read_ct(study_case.ct, study_case.ct_reading, warnings);
  });
  require_target_in_ct(study_case, ct.grid);
  return ct;
}

NodeCt read_ct_per_node(const std::filesystem::path& path,
                        const CtReadOptions& options,
                        const AttenuationModel& model,
                        const Communicator& communicator,
                        std::vector<std::string>& warnings) {
  const auto ct = on_root(communicator, [&] { return read_ct(path, options, &warnings); });
  const Shared<FoundInCt> found =
      ct.then([&](const CtVolume& read) {
          const AttenuatingBox box = attenuating_box(read, model);
          return FoundInCt{facts_of(read, model, box), bordered_grid(read.grid, box)};
        }).share();
  const auto fill = [&](std::span<std::uint16_t> voxels) {
    AttenuationVolume::fill_voxels(ct.value(), model, found->bordered, voxels);
  };
  return {volume_per_node(found->bordered, model, VoxelSource::Root, fill, communicator),
          found->facts};
}

}  // namespace af
