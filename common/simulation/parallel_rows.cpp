// SPDX-License-Identifier: Apache-2.0
#include "simulation/parallel_rows.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace af {

void for_each_row(int rows,
                  int threads,
                  const std::function<void(int row)>& row_work,
                  const ProgressCallback& progress) {
  std::atomic<int> next_row{0};
  std::atomic<int> rows_done{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&](bool reports) {
    try {
      for (int row = next_row++; row < rows; row = next_row++) {
        row_work(row);
        ++rows_done;
        if (reports && progress) progress(rows_done, rows);
      }
    } catch (...) {
      const std::scoped_lock lock(failure_mutex);
      if (!failure) failure = std::current_exception();
      next_row = rows;
    }
  };
  const int hardware = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int count = std::clamp(threads > 0 ? threads : hardware, 1, std::max(1, rows));
  {
    std::vector<std::jthread> helpers;
    for (int i = 1; i < count; ++i) helpers.emplace_back(work, false);
    work(true);
  }
  if (failure) std::rethrow_exception(failure);
  if (progress) progress(rows, rows);
}

}  // namespace af
