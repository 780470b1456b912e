// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "image_files/ct_reader.h"
#include "parallel/communicator.h"
#include "volume/attenuation_volume.h"

namespace af {

/// What is known of a CT without its voxels.
struct CtFacts {
  CtGrid grid;
  std::string content_sha256;
  std::vector<Eigen::Vector3d> cut_points_ct;  ///< see cut_points()

  auto members() {
    return std::tie(
        grid.size, grid.origin_mm, grid.spacing_mm, grid.direction, content_sha256, cut_points_ct);
  }
};

/// The attenuation of a CT, held once per node.
struct NodeCt {
  std::shared_ptr<const AttenuationVolume> volume;
  CtFacts facts;
};

/// Collective. Rank 0 reads the CT, the other nodes get the voxels; errors as read_ct(), on every
/// rank. Only rank 0 ever holds anything but the shared voxels: the file's values and the CT as
/// int16 while it reads, then the CT while it fills the voxels.
NodeCt read_ct_per_node(const std::filesystem::path& path,
                        const CtReadOptions& options,
                        const AttenuationModel& model,
                        const Communicator& communicator,
                        std::vector<std::string>& warnings);

/// Collective. Rank 0 reads the CT for its grid, hash and cuts.
CtFacts read_ct_facts(const std::filesystem::path& path,
                      const CtReadOptions& options,
                      const AttenuationModel& model,
                      const Communicator& communicator,
                      std::vector<std::string>& warnings);

}  // namespace af
