// SPDX-License-Identifier: Apache-2.0
// A discrete-event simulation of the work queue (ranks/work_queue.h) on clusters that we do not
// have. Blocks follow the real rule, costs are measured on one machine, and times of items are
// drawn at random.
#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace af::benchmark {

/// What messages and rows cost.
struct QueueCosts {
  double latency_seconds = 5e-6;  ///< of one message
  double poll_seconds = 25e-6;  ///< mean wait for rank 0, which sleeps 50 us when nothing is there
  double request_seconds = 5e-6;   ///< of rank 0, per request
  double receive_seconds = 20e-6;  ///< of rank 0, per row sent to it
  double write_seconds = 10e-6;    ///< of a rank, per row that it writes itself
  double row_bytes = 500.0;        ///< in a message or a journal
  double kept_row_bytes = 600.0;   ///< of a row in memory
};

/// Durations of items: log-normal, on hosts of different speed (log-normal, too).
struct ItemTimes {
  std::string name;
  double median_seconds = 0.01;
  double log_sigma = 0.5;
  double host_log_sigma = 0.1;
  int ranks_per_host = 64;

  [[nodiscard]] double mean_seconds() const;
};

enum class RowsGo { ToRankZero, ToOwnShard };

struct SimulatedQueue {
  int ranks = 16;
  std::int64_t items = 10'000'000;
  std::int64_t most_per_block = std::numeric_limits<std::int64_t>::max();
  RowsGo rows = RowsGo::ToOwnShard;
  std::uint64_t seed = 1;
};

struct SimulatedRun {
  double seconds = 0.0;
  double efficiency = 0.0;            ///< work over ranks * seconds
  double manager_busy = 0.0;          ///< share of the time that rank 0 answers
  double lost_at_end = 0.0;           ///< share of the ranks' time after their last item
  double longest_wait_seconds = 0.0;  ///< of a request
  double manager_bytes = 0.0;         ///< through rank 0
  double waiting_bytes = 0.0;         ///< most that waited for rank 0 at a time
  double kept_bytes = 0.0;            ///< rows on rank 0 at the end
  std::int64_t requests = 0;
};

/// \test ScaleSimulation.*
SimulatedRun simulated_run(const SimulatedQueue& queue,
                           const ItemTimes& times,
                           const QueueCosts& costs);

}  // namespace af::benchmark
