// SPDX-License-Identifier: Apache-2.0
// Small inputs that rank 0 reads for all, so that ten thousand ranks do not open one file.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "geometry/rigid_transform.h"
#include "ranks/root_only.h"
#include "study/study_file.h"

namespace af {

/// Collective. read_study() on rank 0, which sends the others what it read. What it throws, every
/// rank throws. af-inspect reports what is odd about its rig.
Shared<Study> shared_study(const std::filesystem::path& path, const Communicator& communicator);

/// Collective. read_rig() on rank 0, in the same way. Rank 0 gets the `warnings`.
CameraRig shared_rig(const std::string& name_or_path,
                     const Communicator& communicator,
                     std::vector<std::string>* warnings = nullptr);

/// Collective. What `read` returns on rank 0, to the last bit, on every rank. It is called only
/// there, and what it throws, every rank throws.
std::vector<RigidTransform> shared_poses(const Communicator& communicator,
                                         const std::function<std::vector<RigidTransform>()>& read);

}  // namespace af
