// SPDX-License-Identifier: Apache-2.0
#include "study/node_ct.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>

#include "base/stored_bytes.h"
#include "study/node_volume.h"
#include "volume/cut_faces.h"

namespace af {

namespace {

/// What rank 0 tells the others of the CT that it reads.
struct FoundInCt {
  CtFacts facts;
  CtGrid bordered;  ///< of its attenuation

  auto members() {
    return std::tuple_cat(
        facts.members(),
        std::tie(bordered.size, bordered.origin_mm, bordered.spacing_mm, bordered.direction));
  }
};

FoundInCt found_in(const CtVolume& ct, const AttenuationModel& model) {
  const AttenuatingBox box = attenuating_box(ct, model);
  return {{ct.grid, ct_content_sha256(ct), cut_points(ct, model, box)},
          bordered_grid(ct.grid, box)};
}

/// Collective. Rank 0 reads the CT, into `ct`, and every rank gets what is found in it.
FoundInCt read_on_root(const std::filesystem::path& path,
                       const CtReadOptions& options,
                       const AttenuationModel& model,
                       const Communicator& communicator,
                       CtVolume& ct,
                       std::vector<std::string>& warnings) {
  std::vector<std::byte> bytes;
  all_or_none(communicator, [&] {
    if (!communicator.is_root()) return;
    ct = read_ct(path, options, &warnings);
    bytes = bytes_of(found_in(ct, model));
  });
  communicator.broadcast(bytes);
  return value_of<FoundInCt>(bytes, "the CT of rank 0");
}

}  // namespace

NodeCt read_ct_per_node(const std::filesystem::path& path,
                        const CtReadOptions& options,
                        const AttenuationModel& model,
                        const Communicator& communicator,
                        std::vector<std::string>& warnings) {
  CtVolume ct;
  const FoundInCt found = read_on_root(path, options, model, communicator, ct, warnings);
  const auto fill = [&](std::span<std::uint16_t> voxels) {
    AttenuationVolume::fill_voxels(ct, model, found.bordered, voxels);
  };
  return {volume_per_node(found.bordered, model, VoxelSource::Root, fill, communicator),
          found.facts};
}

CtFacts read_ct_facts(const std::filesystem::path& path,
                      const CtReadOptions& options,
                      const AttenuationModel& model,
                      const Communicator& communicator,
                      std::vector<std::string>& warnings) {
  CtVolume ct;
  return read_on_root(path, options, model, communicator, ct, warnings).facts;
}

}  // namespace af
