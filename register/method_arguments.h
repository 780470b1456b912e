// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/app_forward.h"
#include "register/method/method_options.h"

namespace af::registration {

/// Options of a registration method, the same in every program that registers.
void bind_method(CLI::App& app, MethodOptions& options);

}  // namespace af::registration
