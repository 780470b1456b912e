// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluate/simulate/simulate_options.h"
#include "ranks/communicator.h"

namespace af::tools {

/// Rank 0 works; the others return at once. Writes a study with a known answer, or a cone-beam
/// scan. Throws InputError when the target or a fiducial misses a detector, or a source lies inside
/// the CT.
void run_simulate(const SimulateOptions& options,
                  const std::string& command_line,
                  const Communicator& world);

}  // namespace af::tools
