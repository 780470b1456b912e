// SPDX-License-Identifier: Apache-2.0
#include "benchmark/scale_simulation.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <queue>
#include <vector>

#include "base/hash_random.h"
#include "ranks/work_queue.h"

namespace af::benchmark {

namespace {

constexpr std::uint64_t kHostStream = 1;
constexpr std::uint64_t kItemStream = 2;
constexpr double kRequestBytes = 8.0 + 16.0;  // the request, and the answer

/// A request of a rank with the rows of its last block, on its way to rank 0.
struct Request {
  double arrival = 0.0;
  int rank = 0;
  std::int64_t rows = 0;
};

struct IsLater {
  bool operator()(const Request& a, const Request& b) const { return a.arrival > b.arrival; }
};

class Simulation {
 public:
  Simulation(const SimulatedQueue& queue, const ItemTimes& times, const QueueCosts& costs)
      : queue_(queue), times_(times), costs_(costs), items_(queue.seed, kItemStream) {
    const int hosts = (queue.ranks - 1) / times.ranks_per_host + 1;
    for (int host = 0; host < hosts; ++host)
      slowness_.push_back(
          std::exp(times.host_log_sigma *
                   HashRandom(queue.seed, kHostStream, static_cast<std::uint64_t>(host)).normal()));
    last_item_end_.resize(static_cast<std::size_t>(queue.ranks), 0.0);
  }

  SimulatedRun run() {
    // Rank 0's computing thread takes single items without a message.
    for (int rank = 0; rank < queue_.ranks; ++rank)
      coming_.push({rank == 0 ? 0.0 : costs_.latency_seconds, rank, 0});
    while (!coming_.empty()) {
      const Request request = coming_.top();
      coming_.pop();
      if (request.rank == 0)
        answer_own_thread(request);
      else
        answer(request);
    }
    return result();
  }

 private:
  double work(int rank, std::int64_t items) {
    const double slowness =
        times_.median_seconds * slowness_[static_cast<std::size_t>(rank / times_.ranks_per_host)];
    double seconds = 0.0;
    for (std::int64_t i = 0; i < items; ++i)
      seconds += slowness * std::exp(times_.log_sigma * items_.normal());
    worked_ += seconds;
    return seconds;
  }
  [[nodiscard]] double row_seconds() const {
    return queue_.rows == RowsGo::ToRankZero ? costs_.receive_seconds : 0.0;
  }
  [[nodiscard]] double row_bytes() const {
    return queue_.rows == RowsGo::ToRankZero ? costs_.row_bytes : 0.0;
  }

  /// A rank that got `items` at `time` computes, writes its rows if it keeps them itself, and asks
  /// again.
  void start(int rank, double time, std::int64_t items, double way_seconds) {
    double end = time + work(rank, items);
    if (queue_.rows == RowsGo::ToOwnShard) end += static_cast<double>(items) * costs_.write_seconds;
    last_item_end_[static_cast<std::size_t>(rank)] = end;
    coming_.push({end + way_seconds, rank, items});
  }

  std::int64_t take(std::int64_t wanted) {
    const std::int64_t taken = std::min(wanted, queue_.items - next_);
    next_ += taken;
    return taken;
  }

  void answer_own_thread(const Request& request) {
    serve(request.arrival, 0.0, static_cast<double>(request.rows) * row_seconds());
    done_ += request.rows;
    if (const std::int64_t items = take(1); items > 0) start(0, request.arrival, items, 0.0);
  }

  void answer(const Request& request) {
    const auto rows = static_cast<double>(request.rows);
    const double granted = serve(request.arrival, costs_.request_seconds, rows * row_seconds());
    ++result_.requests;
    result_.manager_bytes += kRequestBytes + rows * row_bytes();
    note_waiting(request.arrival, granted, rows * row_bytes());
    result_.longest_wait_seconds =
        std::max(result_.longest_wait_seconds, granted - request.arrival);
    done_ += request.rows;
    const std::int64_t items = take(std::min(
        block_size(queue_.items - next_, done_, queue_.ranks, granted), queue_.most_per_block));
    if (items > 0)
      start(request.rank, granted + costs_.latency_seconds, items, costs_.latency_seconds);
  }

  /// Rank 0 answers first, then looks at the rows, one request after the other. Returns the time at
  /// which it has answered.
  double serve(double arrival, double answer_seconds, double rows_seconds) {
    const double begin = arrival > free_at_ ? arrival + costs_.poll_seconds : free_at_;
    const double answered = begin + answer_seconds;
    free_at_ = answered + rows_seconds;
    busy_ += answer_seconds + rows_seconds;
    return answered;
  }

  void note_waiting(double arrival, double taken, double bytes) {
    while (!waiting_.empty() && waiting_.front().first <= arrival) {
      waiting_bytes_ -= waiting_.front().second;
      waiting_.pop_front();
    }
    waiting_.emplace_back(taken, bytes);
    waiting_bytes_ += bytes;
    result_.waiting_bytes = std::max(result_.waiting_bytes, waiting_bytes_);
  }

  SimulatedRun result() {
    result_.seconds =
        std::max(free_at_, *std::max_element(last_item_end_.begin(), last_item_end_.end()));
    const double all = result_.seconds * queue_.ranks;
    double idle = 0.0;
    for (const double end : last_item_end_) idle += result_.seconds - end;
    result_.efficiency = worked_ / all;
    result_.lost_at_end = idle / all;
    result_.manager_busy = busy_ / result_.seconds;
    if (queue_.rows == RowsGo::ToRankZero)
      result_.kept_bytes = static_cast<double>(queue_.items) * costs_.kept_row_bytes;
    return result_;
  }

  const SimulatedQueue& queue_;
  const ItemTimes& times_;
  const QueueCosts& costs_;
  HashRandom items_;
  std::vector<double> slowness_;       ///< of each host
  std::vector<double> last_item_end_;  ///< of each rank
  std::priority_queue<Request, std::vector<Request>, IsLater> coming_;
  std::int64_t next_ = 0;
  std::int64_t done_ = 0;  ///< as rank 0 knows
  double free_at_ = 0.0;   ///< rank 0's answering thread
  double busy_ = 0.0;
  double worked_ = 0.0;
  std::deque<std::pair<double, double>> waiting_;  ///< when each is taken, and its bytes
  double waiting_bytes_ = 0.0;
  SimulatedRun result_;
};

}  // namespace

double ItemTimes::mean_seconds() const {
  return median_seconds * std::exp(0.5 * log_sigma * log_sigma);
}

SimulatedRun simulated_run(const SimulatedQueue& queue,
                           const ItemTimes& times,
                           const QueueCosts& costs) {
  return Simulation(queue, times, costs).run();
}

}  // namespace af::benchmark
