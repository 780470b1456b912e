// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

namespace af {

/// Numerics report progress through this callable (work done, whole work). Programs print it with
/// an ETA. It may be empty.
using ProgressCallback = std::function<void(double done, double total)>;

}  // namespace af
