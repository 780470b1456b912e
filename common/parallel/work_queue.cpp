// SPDX-License-Identifier: Apache-2.0
#include "parallel/work_queue.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "parallel/mpi_handle.h"
#include "parallel/work_watch.h"

namespace af {

namespace {

constexpr int kRequestTag = 11;
constexpr int kGrantTag = 12;

using Bytes = std::vector<std::byte>;
using Receive = std::function<void(std::int64_t item, std::span<const std::byte> result)>;

void append_number(Bytes& bytes, std::int64_t number) {
  const auto* const first = reinterpret_cast<const std::byte*>(&number);
  bytes.insert(bytes.end(), first, first + sizeof(number));
}

std::int64_t take_number(std::span<const std::byte>& bytes) {
  std::int64_t number = 0;
  std::memcpy(&number, bytes.data(), sizeof(number));
  bytes = bytes.subspan(sizeof(number));
  return number;
}

/// Results travel and wait as item, size, bytes; item, size, bytes; ...
void append_result(Bytes& packed, std::int64_t item, const Bytes& result) {
  append_number(packed, item);
  append_number(packed, static_cast<std::int64_t>(result.size()));
  packed.insert(packed.end(), result.begin(), result.end());
}

/// What all ranks do.
struct Job {
  std::int64_t count = 0;
  std::int64_t most_per_block = std::numeric_limits<std::int64_t>::max();
  std::function<Bytes(std::int64_t item)> work;
  Receive receive;
  std::function<void(std::int64_t done)> on_progress;

  [[nodiscard]] Bytes result_of(std::int64_t item) const {
    const WorkNote note("item " + std::to_string(item + 1) + " of " + std::to_string(count));
    return work(item);
  }
};

struct Block {
  std::int64_t first = 0;
  std::int64_t count = 0;  ///< 0: no more work
};

/// State of the hand-out on rank 0, shared by its computing thread and its answering thread.
class Ledger {
 public:
  Ledger(const Job& job, int ranks)
      : count_(job.count), most_per_block_(job.most_per_block), ranks_(ranks) {}

  Block take_fair_share() {
    const std::scoped_lock lock(mutex_);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
    return take(
        std::min(block_size(count_ - next_, done_, ranks_, elapsed.count()), most_per_block_));
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
  std::int64_t most_per_block_;
  int ranks_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::int64_t next_ = 0;
  std::int64_t done_ = 0;
};

/// Results on their way to Job::receive, on rank 0.
class Inbox {
 public:
  Inbox(const Job& job, Ledger& ledger) : job_(job), ledger_(ledger) {}

  /// From the computing thread.
  void add(std::int64_t item, const Bytes& result) {
    const std::scoped_lock lock(mutex_);
    append_result(waiting_, item, result);
  }
  /// The rest in the answering thread.
  void deliver_waiting() {
    Bytes packed;
    {
      const std::scoped_lock lock(mutex_);
      packed.swap(waiting_);
    }
    deliver(packed);
  }
  void deliver(std::span<const std::byte> packed) {
    while (!packed.empty()) {
      const std::int64_t item = take_number(packed);
      const auto size = static_cast<std::size_t>(take_number(packed));
      receive(item, packed.first(size));
      packed = packed.subspan(size);
      ledger_.add_done(1);
    }
  }
  [[nodiscard]] const RankFailure& failure() const { return failure_; }

 private:
  /// After a failure nothing is given any more, and no more work handed out.
  void receive(std::int64_t item, std::span<const std::byte> result) {
    if (failure_.exit_code != 0) return;
    try {
      if (job_.receive) job_.receive(item, result);
    } catch (...) {
      failure_ = failure_of(std::current_exception());
      ledger_.stop();
    }
  }

  const Job& job_;
  Ledger& ledger_;
  std::mutex mutex_;
  Bytes waiting_;
  RankFailure failure_;
};

/// Answers one request when there is one; `active_workers` falls when a worker is sent home.
/// Messages, not one-sided windows: those fail across hosts over TCP or stall while the target
/// computes.
bool answer_request(MPI_Comm handle, Ledger& ledger, Inbox& inbox, int& active_workers) {
  int arrived = 0;
  MPI_Status status;
  MPI_Iprobe(MPI_ANY_SOURCE, kRequestTag, handle, &arrived, &status);
  if (arrived == 0) return false;
  int size = 0;
  MPI_Get_count(&status, MPI_BYTE, &size);
  // Whether the rank failed, then what it finished since the last request.
  Bytes request(static_cast<std::size_t>(size));
  MPI_Recv(
      request.data(), size, MPI_BYTE, status.MPI_SOURCE, kRequestTag, handle, MPI_STATUS_IGNORE);
  std::span<const std::byte> rest = request;
  if (take_number(rest) != 0) ledger.stop();
  // The worker goes on before its results are looked at.
  const Block block = ledger.take_fair_share();
  const std::array<std::int64_t, 2> grant{block.first, block.count};
  MPI_Send(grant.data(), 2, MPI_INT64_T, status.MPI_SOURCE, kGrantTag, handle);
  if (block.count == 0) --active_workers;
  inbox.deliver(rest);
  return true;
}

/// Rank 0's own share of the work, item by item.
RankFailure work_until_empty(const Job& job, Ledger& ledger, Inbox& inbox) {
  try {
    for (Block block = ledger.take_one(); block.count > 0; block = ledger.take_one())
      inbox.add(block.first, job.result_of(block.first));
  } catch (...) {
    ledger.stop();
    return failure_of(std::current_exception());
  }
  return {};
}

/// Rank 0 computes in a second thread, so that a long item does not keep other ranks waiting; MPI
/// stays in this one.
RankFailure run_as_manager(const Communicator& communicator, const Job& job) {
  Ledger ledger(job, communicator.size());
  Inbox inbox(job, ledger);
  RankFailure failure;
  std::atomic<bool> is_computing{true};
  std::thread computing([&] {
    failure = work_until_empty(job, ledger, inbox);
    is_computing = false;
  });
  int active_workers = communicator.size() - 1;
  std::int64_t reported = 0;
  const auto report_progress = [&] {
    if (const std::int64_t done = ledger.done(); job.on_progress && done > reported)
      job.on_progress(reported = done);
  };
  std::optional<WaitNote> waits;
  while (is_computing || active_workers > 0) {
    if (!is_computing && !waits) waits.emplace();
    inbox.deliver_waiting();
    if (active_workers > 0 &&
        answer_request(communicator.impl().handle, ledger, inbox, active_workers))
      continue;
    report_progress();
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  computing.join();
  inbox.deliver_waiting();
  report_progress();
  return failure.exit_code != 0 ? failure : inbox.failure();
}

std::array<std::int64_t, 2> next_grant(MPI_Comm handle) {
  const WaitNote waits;
  std::array<std::int64_t, 2> grant{};
  MPI_Recv(grant.data(), 2, MPI_INT64_T, 0, kGrantTag, handle, MPI_STATUS_IGNORE);
  return grant;
}

RankFailure run_as_worker(const Communicator& communicator, const Job& job) {
  const MPI_Comm handle = communicator.impl().handle;
  RankFailure failure;
  Bytes finished;
  while (true) {
    Bytes request;
    append_number(request, failure.exit_code != 0 ? 1 : 0);
    request.insert(request.end(), finished.begin(), finished.end());
    MPI_Send(request.data(), static_cast<int>(request.size()), MPI_BYTE, 0, kRequestTag, handle);
    const std::array<std::int64_t, 2> grant = next_grant(handle);
    if (grant[1] == 0) return failure;
    finished.clear();
    try {
      for (std::int64_t i = 0; i < grant[1]; ++i)
        append_result(finished, grant[0] + i, job.result_of(grant[0] + i));
    } catch (...) {
      failure = failure_of(std::current_exception());
    }
  }
}

void run_job(const Communicator& communicator, const Job& job) {
  const RankFailure mine =
      communicator.is_root() ? run_as_manager(communicator, job) : run_as_worker(communicator, job);
  if (const RankFailure failure = first_failure(communicator, mine); failure.exit_code != 0)
    throw_failure(failure);
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
  Job job;
  job.count = count;
  job.work = [&](std::int64_t item) {
    work(item);
    return Bytes();
  };
  job.on_progress = on_progress;
  run_job(communicator, job);
}

void collect_items(const Communicator& communicator,
                   std::int64_t count,
                   const std::function<Bytes(std::int64_t item)>& work,
                   const Receive& receive,
                   const std::function<void(std::int64_t done)>& on_progress) {
  // Few enough that their results stay small in memory and in one message.
  constexpr std::int64_t kMostPerBlock = 64;
  run_job(communicator, {count, kMostPerBlock, work, receive, on_progress});
}

}  // namespace af
