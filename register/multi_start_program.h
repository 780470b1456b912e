// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "parallel/communicator.h"
#include "register/registration.h"
#include "register/result_files.h"

namespace af::registration {

/// Collective. Registers from every start, the starts shared over the ranks as these become free.
/// Rank 0 returns one record per start, in the order of starts; the others return none. Only the
/// record of the highest similarity (ties: the lowest start index) keeps its trace, so that memory
/// does not grow with the number of starts. `on_progress` is called on rank 0 with the number done.
std::vector<RegistrationRecord> register_starts(
    RegistrationRunner& runner,
    std::span<const RigidTransform> starts,
    const Communicator& communicator,
    const std::function<void(std::int64_t done)>& on_progress = {});

}  // namespace af::registration
