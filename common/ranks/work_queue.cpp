// SPDX-License-Identifier: Apache-2.0
#include "ranks/work_queue.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "ranks/rank_group.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

/// What every rank needs to do items.
struct Job {
  std::int64_t count = 0;
  const std::function<void(std::int64_t item)>& work;
  const std::function<void(std::int64_t done)>& on_progress;

  void do_item(std::int64_t item) const {
    const WorkNote note("item " + std::to_string(item + 1) + " of " + std::to_string(count));
    work(item);
  }
};

using Block = RankGroup::Grant;
using Request = RankGroup::Request;

/// State of the hand-out on rank 0, shared by its computing thread and its answering thread.
class Ledger {
 public:
  Ledger(std::int64_t count, int ranks) : count_(count), ranks_(ranks) {}

  Block take_fair_share() {
    const std::scoped_lock lock(mutex_);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
    return take(block_size(count_ - next_, done_, ranks_, elapsed.count()));
  }
  Block take_one() {
    const std::scoped_lock lock(mutex_);
    return take(1);
  }
  /// From now on no items are handed out.
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
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::int64_t next_ = 0;
  std::int64_t done_ = 0;
};

/// Answers one request when there is one. `active_workers` falls when a worker gets no more work.
bool answer_request(RankGroup& ranks, Ledger& ledger, int& active_workers) {
  return ranks.answer_request([&](const Request& request) {
    ledger.add_done(request.finished);
    if (request.has_failed != 0) ledger.stop();
    const Block block = ledger.take_fair_share();
    if (block.count == 0) --active_workers;
    return block;
  });
}

/// Rank 0's own share of the work, item by item.
RankFailure work_until_empty(const Job& job, Ledger& ledger) {
  try {
    for (Block block = ledger.take_one(); block.count > 0; block = ledger.take_one()) {
      job.do_item(block.first);
      ledger.add_done(1);
    }
  } catch (...) {
    ledger.stop();
    return failure_of(std::current_exception());
  }
  return {};
}

/// Rank 0 computes in a second thread, so that a long item does not keep other ranks waiting. MPI
/// stays in this thread.
RankFailure run_as_manager(const Communicator& communicator, const Job& job) {
  Ledger ledger(job.count, communicator.size());
  RankFailure failure_of_work;
  RankFailure failure_of_report;
  std::atomic<bool> is_computing{true};
  std::jthread computing([&] {
    failure_of_work = work_until_empty(job, ledger);
    is_computing = false;
  });
  int active_workers = communicator.size() - 1;
  std::int64_t reported = 0;
  // The other ranks wait for their grants whatever happens here.
  const auto report_progress = [&] {
    const std::int64_t done = ledger.done();
    if (!job.on_progress || done <= reported || failure_of_report.exit_code != 0) return;
    try {
      job.on_progress(reported = done);
    } catch (...) {
      ledger.stop();
      failure_of_report = failure_of(std::current_exception());
    }
  };
  std::optional<WaitNote> waits;
  while (is_computing || active_workers > 0) {
    if (!is_computing && !waits) waits.emplace();
    if (active_workers > 0 && answer_request(*communicator.group(), ledger, active_workers))
      continue;
    report_progress();
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  computing.join();
  report_progress();
  return failure_of_work.exit_code != 0 ? failure_of_work : failure_of_report;
}

Block next_block(RankGroup& ranks, const Request& request) {
  const WaitNote waits;
  return ranks.ask(request);
}

RankFailure run_as_worker(const Communicator& communicator, const Job& job) {
  RankFailure failure;
  Request request;
  while (true) {
    const Block block = next_block(*communicator.group(), request);
    if (block.count == 0) return failure;
    request.finished = 0;
    try {
      for (; request.finished < block.count; ++request.finished)
        job.do_item(block.first + request.finished);
    } catch (...) {
      failure = failure_of(std::current_exception());
      request.has_failed = 1;
    }
  }
}

}  // namespace

std::int64_t block_size(std::int64_t items_left,
                        std::int64_t items_done,
                        int ranks,
                        double elapsed_seconds) {
  if (items_done == 0) return 1;
  const std::int64_t share = items_left / (std::int64_t{4} * ranks);
  constexpr double kMostSeconds = 2.0;
  const double items_in_time =
      kMostSeconds * static_cast<double>(items_done) / (elapsed_seconds * ranks);
  return static_cast<std::int64_t>(
      std::clamp(items_in_time, 1.0, std::max(1.0, static_cast<double>(share))));
}

void for_each_item(const Communicator& communicator,
                   std::int64_t count,
                   const std::function<void(std::int64_t item)>& work,
                   const std::function<void(std::int64_t done)>& on_progress) {
  const Job job{count, work, on_progress};
  const RankFailure mine =
      communicator.is_root() ? run_as_manager(communicator, job) : run_as_worker(communicator, job);
  if (const RankFailure failure = first_failure(communicator, mine); failure.exit_code != 0)
    throw_failure(failure);
}

}  // namespace af
