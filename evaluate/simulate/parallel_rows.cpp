// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/parallel_rows.h"

#include <algorithm>
#include <atomic>
#include <thread>

#include "base/thread_pool.h"

namespace af {

void for_each_row(int rows,
                  int threads,
                  const std::function<void(int row)>& row_work,
                  const ProgressCallback& progress) {
  ThreadPool pool(std::clamp(thread_count(threads), 1, std::max(1, rows)));
  const std::thread::id caller = std::this_thread::get_id();
  std::atomic<int> rows_done{0};
  pool.for_each(rows, [&](int row, int /*slot*/) {
    row_work(row);
    ++rows_done;
    if (progress && std::this_thread::get_id() == caller) progress(rows_done, rows);
  });
  if (progress) progress(rows, rows);
}

}  // namespace af
