// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/method/registration_options.h"

namespace af::registration {

/// The two passes of the paper (Sec. III-B2). The paper lost the value of its sigma;
/// register/README.md says how we chose ours.
ChainOptions paper_chain();

std::vector<std::string> preset_names();
/// One line for --help.
std::string preset_help();
/// InputError that lists the known names.
RegistrationOptions preset_options(const std::string& name);

}  // namespace af::registration
