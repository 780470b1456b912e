// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "geometry/orbit.h"

namespace af {

/// The orbit of "axis=z,from=-90,to=90,step=20" (degrees; the step may be left out). Throws
/// UsageError, which names `option`, for anything else.
Orbit orbit_of_text(const std::string& option, const std::string& text);

}  // namespace af
