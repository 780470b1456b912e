// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace af::test {

/// Calls of operator new so far, of all threads. A program that links counted_allocations.cpp has
/// its operators replaced by ones that count.
long allocation_count();

}  // namespace af::test
