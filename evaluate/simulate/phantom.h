// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "evaluate/simulate/phantom_parts.h"

namespace af {

/// Names of the phantoms, and one line that explains them.
std::vector<std::string> phantom_names();
std::string phantom_help();

/// The bones of each phantom that can be moved: "spine: T9, T10 ...; pelvis: ...".
std::string bone_help();

/// A phantom by its name; throws InputError for any other name. With a seed, it is the patient of
/// that number instead of the typical adult.
Phantom make_phantom(const std::string& name,
                     bool has_metal,
                     std::optional<std::int64_t> anatomy_seed = {});

}  // namespace af
