// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "simulation/phantom_parts.h"

namespace af {

/// Names of the phantoms, and one line that explains them.
std::vector<std::string> phantom_names();
std::string phantom_help();

/// A phantom by its name; InputError for any other.
Phantom make_phantom(const std::string& name, bool has_metal);

}  // namespace af
