// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace af {

/// Shortest text that reads back to the same double ("nan", "inf" for those).
std::string number_text(double value);

}  // namespace af
