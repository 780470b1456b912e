// SPDX-License-Identifier: Apache-2.0
// A bone that X-rays show at another place relative to the rest than the CT does.
#pragma once

#include <cstdint>
#include <string_view>

#include "evaluate/simulate/phantom_parts.h"
#include "geometry/rigid_transform.h"

namespace af {

/// Where a bone's points, as the CT has them, lie relative to the rest (both ct, mm). The bone is
/// turned by 2 to 5 degrees about an axis through `center_ct_mm`, which is moved by 2 to 6 mm, both
/// uniform. Of 64 drawn pairs of directions, the one that takes the least of the bone into other
/// bone, metal or air is used. Keyed by (seed, key). The mean displacement over a box centred there
/// is at least the centre's.
/// \test MovedBone.TurnsAndShiftsByWhatIsStated
RigidTransform drawn_rest_from_bone(const Phantom& phantom,
                                    std::string_view bone,
                                    const Eigen::Vector3d& center_ct_mm,
                                    std::uint64_t seed,
                                    std::uint64_t key);

/// The phantom with the bodies of one bone moved. Everything else (other bones, discs, a socket)
/// stays, and shows where the bone was. Elsewhere muscle does. \test
/// EveryMovedBone.LeavesSoftTissueWhereItWas
Phantom with_moved_bone(Phantom phantom,
                        std::string_view bone,
                        const RigidTransform& rest_from_bone);

}  // namespace af
