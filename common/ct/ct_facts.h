// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Core>

#include "ct/attenuation_volume.h"
#include "ct/ct_identity.h"
#include "ct/ct_read_options.h"

namespace af {

/// What is known of a CT without its voxels.
struct CtFacts {
  CtGrid grid;
  CtIdentity identity;
  std::vector<Eigen::Vector3d> cut_points_ct;  ///< see cut_points()

  auto members() {
    return std::tie(
        grid.size, grid.origin_mm, grid.spacing_mm, grid.direction, identity, cut_points_ct);
  }
};

/// `box` is the CT's attenuating_box().
CtFacts facts_of(const CtVolume& ct, const AttenuationModel& model, const AttenuatingBox& box);

/// The facts, and a part of the CT's attenuation.
struct KnownCt {
  CtFacts facts;
  VolumePart part;

  auto members() { return std::tie(facts, part); }
};

/// read_ct_facts(), and the part of the CT within a box of the ct frame, kept likewise. Without a
/// box the part is empty.
KnownCt read_known_ct(const std::filesystem::path& path,
                      const CtReadOptions& options,
                      const AttenuationModel& model,
                      const std::optional<CtBox>& box_ct,
                      std::vector<std::string>& warnings);

/// facts_of() what read_ct() reads, with its errors and warnings. Voxels are decoded only if the
/// user's cache (files/user_cache.h) does not know files of these bytes under this path, read in
/// this way. Otherwise the files are only hashed.
CtFacts read_ct_facts(const std::filesystem::path& path,
                      const CtReadOptions& options,
                      const AttenuationModel& model,
                      std::vector<std::string>& warnings);

}  // namespace af
