// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

namespace af {

/// Numerics report progress through this callable (work done, work in all); programs print it with
/// an ETA. May be empty.
using ProgressCallback = std::function<void(double done, double total)>;

}  // namespace af
