// SPDX-License-Identifier: Apache-2.0
#include "parallel/work_queue.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

#include "parallel/mpi_handle.h"

namespace af {

namespace {

constexpr int kRequestTag = 11;
constexpr int kGrantTag = 12;

struct Block {
  std::int64_t first = 0;
  std::int64_t count = 0;  ///< 0: no more work
};

/// State of the hand-out on rank 0, shared by its computing thread and its answering thread.
class Ledger {
 public:
  Ledger(std::int64_t count, int ranks) : count_(count), ranks_(ranks) {}

  /// Blocks shrink towards the end so that ranks finish together.
  Block take_fair_share() {
    const std::scoped_lock lock(mutex_);
    return take(std::max<std::int64_t>(1, (count_ - next_) / (std::int64_t{4} * ranks_)));
  }
  Block take_one() {
    const std::scoped_lock lock(mutex_);
    return take(1);
  }
  /// No further items are handed out.
  void stop() {
    const std::scoped_lock lock(mutex_);
    next_ = count_;
  }
  void add_done(std::int64_t items) {
    const std::scoped_lock lock(mutex_);
    done_ += items;
  }
  [[nodiscard]] std::int64_t done() {
    const std::scoped_lock lock(mutex_);
    return done_;
  }

 private:
  Block take(std::int64_t wanted) {
    const Block block{next_, std::min(wanted, count_ - next_)};
    next_ += block.count;
    return block;
  }

  std::mutex mutex_;
  std::int64_t count_;
  int ranks_;
  std::int64_t next_ = 0;
  std::int64_t done_ = 0;
};

/// Answers one request when there is one; `active_workers` falls when a worker is sent home.
/// Messages, not one-sided windows: those fail across hosts over TCP or stall while the target
/// computes.
bool answer_request(MPI_Comm handle, Ledger& ledger, int& active_workers) {
  int arrived = 0;
  MPI_Status status;
  MPI_Iprobe(MPI_ANY_SOURCE, kRequestTag, handle, &arrived, &status);
  if (arrived == 0) return false;
  // {items finished since the last request, whether the rank failed}
  std::array<std::int64_t, 2> request{};
  MPI_Recv(
      request.data(), 2, MPI_INT64_T, status.MPI_SOURCE, kRequestTag, handle, MPI_STATUS_IGNORE);
  ledger.add_done(request[0]);
  if (request[1] != 0) ledger.stop();
  const Block block = ledger.take_fair_share();
  const std::array<std::int64_t, 2> grant{block.first, block.count};
  MPI_Send(grant.data(), 2, MPI_INT64_T, status.MPI_SOURCE, kGrantTag, handle);
  if (block.count == 0) --active_workers;
  return true;
}

/// Rank 0's own share of the work, item by item.
RankFailure work_until_empty(Ledger& ledger, const std::function<void(std::int64_t)>& work) {
  try {
    for (Block block = ledger.take_one(); block.count > 0; block = ledger.take_one()) {
      work(block.first);
      ledger.add_done(1);
    }
  } catch (...) {
    ledger.stop();
    return failure_of(std::current_exception());
  }
  return {};
}

/// Rank 0 computes in a second thread, so that a long item does not keep other ranks waiting; MPI
/// stays in this one.
RankFailure run_as_manager(const Communicator& communicator,
                           std::int64_t count,
                           const std::function<void(std::int64_t)>& work,
                           const std::function<void(std::int64_t)>& on_progress) {
  Ledger ledger(count, communicator.size());
  RankFailure failure;
  std::atomic<bool> is_computing{true};
  std::thread computing([&] {
    failure = work_until_empty(ledger, work);
    is_computing = false;
  });
  int active_workers = communicator.size() - 1;
  std::int64_t reported = 0;
  while (is_computing || active_workers > 0) {
    if (active_workers > 0 && answer_request(communicator.impl().handle, ledger, active_workers))
      continue;
    if (const std::int64_t done = ledger.done(); on_progress && done > reported)
      on_progress(reported = done);
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  computing.join();
  if (on_progress && ledger.done() > reported) on_progress(ledger.done());
  return failure;
}

RankFailure run_as_worker(const Communicator& communicator,
                          const std::function<void(std::int64_t)>& work) {
  const MPI_Comm handle = communicator.impl().handle;
  RankFailure failure;
  std::int64_t finished = 0;
  while (true) {
    const std::array<std::int64_t, 2> request{finished, failure.exit_code != 0 ? 1 : 0};
    MPI_Send(request.data(), 2, MPI_INT64_T, 0, kRequestTag, handle);
    std::array<std::int64_t, 2> grant{};
    MPI_Recv(grant.data(), 2, MPI_INT64_T, 0, kGrantTag, handle, MPI_STATUS_IGNORE);
    if (grant[1] == 0) return failure;
    finished = 0;
    try {
      for (std::int64_t i = 0; i < grant[1] && failure.exit_code == 0; ++i) {
        work(grant[0] + i);
        ++finished;
      }
    } catch (...) {
      failure = failure_of(std::current_exception());
    }
  }
}

}  // namespace

void for_each_item(const Communicator& communicator,
                   std::int64_t count,
                   const std::function<void(std::int64_t item)>& work,
                   const std::function<void(std::int64_t done)>& on_progress) {
  const RankFailure mine = communicator.is_root()
                               ? run_as_manager(communicator, count, work, on_progress)
                               : run_as_worker(communicator, work);
  if (const RankFailure failure = first_failure(communicator, mine); failure.exit_code != 0)
    throw_failure(failure);
}

}  // namespace af
