// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "geometry/rigid_transform.h"
#include "register/problem/registration_problem.h"

namespace af::registration {

/// Picture of one view before and after a registration: the X-ray's region twice, with the outlines
/// of the DRR at the start and at the found pose. The same outlines on the same anatomy are a pose
/// that fits.
void write_outlines(const RegistrationView& view,
                    const RigidTransform& start_room_from_ct,
                    const RigidTransform& room_from_ct,
                    const std::string& heading,
                    const std::filesystem::path& path);

}  // namespace af::registration
