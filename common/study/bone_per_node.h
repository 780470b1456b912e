// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "parallel/communicator.h"
#include "volume/attenuation_volume.h"

namespace af {

/// Collective. The part of a CT's attenuation that is bone (bone_volume()), held once per node.
/// InputError when there is none.
std::shared_ptr<const AttenuationVolume> bone_per_node(const AttenuationVolume& volume,
                                                       const Communicator& communicator);

}  // namespace af
