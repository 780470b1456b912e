// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "precompute/build/precompute_options.h"
#include "ranks/communicator.h"

namespace af {

/// Collective. Runs af-precompute: reads, casts, trains, encodes and writes one field, or prints
/// the dry run.
void run_precompute(const PrecomputeOptions& options,
                    const std::string& command_line,
                    const Communicator& communicator);

}  // namespace af
