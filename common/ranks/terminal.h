// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "ranks/communicator.h"

namespace af {

/// Informs the person at the terminal, on standard error, from rank 0 only. Results go to standard
/// output.
void inform(const Communicator& communicator, const std::string& message);
/// The same for a warning, once per run however often it is given.
void warn(const Communicator& communicator, const std::string& message);

}  // namespace af
