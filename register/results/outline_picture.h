// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "geometry/rigid_transform.h"
#include "register/problem/registration_problem.h"

namespace af::registration {

/// Picture of one view before and after a registration: the X-ray's region twice, with the outlines
/// of the DRR at the start and at the found pose. A pose fits when the outlines lie on the same
/// anatomy.
void write_outlines(const RegistrationView& view,
                    const RigidTransform& start_room_from_ct,
                    const RigidTransform& room_from_ct,
                    const std::string& heading,
                    const std::filesystem::path& path);

}  // namespace af::registration
