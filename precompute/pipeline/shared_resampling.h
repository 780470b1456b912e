// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "parallel/communicator.h"
#include "precompute/casting/slab_aligned_volume.h"

namespace af {

/// Collective. The volume resampled to a slab frame, held once per node; the ranks of a node share
/// the work. Equal to SlabAlignedVolume(volume, slab_from_ct, options).
SlabAlignedVolume resample_on_node(const AttenuationVolume& volume,
                                   const RigidTransform& slab_from_ct,
                                   const SlabAlignedOptions& options,
                                   const Communicator& communicator);

}  // namespace af
