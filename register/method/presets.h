// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/method/registration_options.h"

namespace af::registration {

std::vector<std::string> preset_names();
/// One line for --help.
std::string preset_help();
/// The preset of that name. Throws InputError that lists the known names.
RegistrationOptions preset_options(const std::string& name);

}  // namespace af::registration
