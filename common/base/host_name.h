// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace af {

/// Name of this host.
std::string host_name();

}  // namespace af
