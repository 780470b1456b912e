// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "evaluate/perturbed_starts.h"
#include "evaluate/yardstick_files.h"
#include "parallel/communicator.h"

namespace af::evaluation {

/// Collective. The starts that `make` gives on rank 0, none on the other ranks; errors of `make`
/// are thrown on every rank. A TRE is a mean over every target point of the yardstick, which takes
/// most of the time: all ranks share those that `make` asks for.
StratifiedStarts starts_measured_together(
    const Communicator& world,
    const Yardstick& yardstick,
    const std::function<StratifiedStarts(const MeasureTres& measure_tres)>& make);

}  // namespace af::evaluation
