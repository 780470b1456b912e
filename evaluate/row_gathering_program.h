// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "parallel/communicator.h"

namespace af::evaluation {

/// Collective. The rows of all ranks on rank 0 (none elsewhere), sorted by their element 0, a whole
/// number. Rows travel as CBOR: doubles keep every bit, NaN and infinity.
std::vector<nlohmann::json> gather_rows(const Communicator& communicator,
                                        const std::vector<nlohmann::json>& mine);

}  // namespace af::evaluation
