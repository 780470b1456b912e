// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace af::test {

/// Calls of operator new so far, of all threads. counted_allocations.cpp replaces the operators of
/// a program that links it by ones that count.
long allocation_count();

}  // namespace af::test
