// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "base/progress.h"

namespace af {

/// Calls `row_work(row)` once for every row in [0, rows), on `threads` threads (0: every processor
/// of this process), including the caller's. Rows must be independent of each other. Progress is
/// reported from the caller's thread. Throws the exception of the lowest row that failed.
void for_each_row(int rows,
                  int threads,
                  const std::function<void(int row)>& row_work,
                  const ProgressCallback& progress = {});

}  // namespace af
