// SPDX-License-Identifier: Apache-2.0
#include "base/thread_pool.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <sched.h>

#include "base/error.h"
#include "base/fork_aware_mutex.h"
#include "base/processor.h"
#include "base/stop_condition.h"

namespace af {
namespace {

constexpr int kMostThreads = 1024;

/// How long a thread watches for work before it sleeps. Waking it takes about as long, and the time
/// between two evaluations of a registration is shorter.
constexpr std::chrono::microseconds kWatchTime{100};

/// Which pool the running thread helps in, and its slot there.
struct Membership {
  const ThreadPool* pool = nullptr;
  int slot = 0;
};
thread_local Membership my_membership;

/// Waits until `is_over()`, at most for kWatchTime. Returns whether it is over.
template <typename Condition>
bool watch(Condition is_over) {
  constexpr int kChecksPerLook = 32;
  const auto until = std::chrono::steady_clock::now() + kWatchTime;
  do {
    for (int i = 0; i < kChecksPerLook; ++i) {
      if (is_over()) return true;
      processor::pause();
    }
  } while (std::chrono::steady_clock::now() < until);
  return is_over();
}

}  // namespace

int usable_processors() {
  cpu_set_t mine;
  CPU_ZERO(&mine);
  if (sched_getaffinity(0, sizeof(mine), &mine) == 0) return std::max(1, CPU_COUNT(&mine));
  // The machine has more processors than the set can hold.
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

int thread_count(int requested) {
  return requested > 0 ? requested : usable_processors();
}

std::vector<std::string> thread_problems(int requested) {
  if (requested >= 0 && requested <= kMostThreads) return {};
  return {"threads = " + std::to_string(requested) + ": must be 0 (all processors) ... " +
          std::to_string(kMostThreads)};
}

ThreadPool::ThreadPool(int threads) : generation_(fork_generation()) {
  check(threads >= 1, "a pool has at least one thread");
  // Loops are nested only a few deep.
  open_.reserve(4 * static_cast<std::size_t>(threads));
  start_helpers(threads - 1);
}

ThreadPool::~ThreadPool() {
  if (generation_ != fork_generation()) forget_helpers();
  is_ending_ = true;
  ++news_;
  news_.notify_all();
}

int ThreadPool::my_slot() const {
  return my_membership.pool == this ? my_membership.slot : 0;
}

void ThreadPool::start_helpers(int count) {
  helpers_.reserve(static_cast<std::size_t>(count));
  for (int slot = 1; slot <= count; ++slot) helpers_.emplace_back([this, slot] { help(slot); });
}

/// After a fork, the helpers are threads of another process. They can neither be joined nor
/// destroyed, and what they were doing stays undone.
void ThreadPool::forget_helpers() {
  static_cast<void>(new std::vector<std::jthread>(std::move(helpers_)));
  helpers_.clear();
  std::construct_at(&mutex_);
  open_.clear();
  generation_ = fork_generation();
}

void ThreadPool::run(Loop& loop) {
  if (generation_ != fork_generation()) {
    const auto count = static_cast<int>(helpers_.size());
    forget_helpers();
    start_helpers(count);
  }
  StopCondition* const condition = StopCondition::current();
  if (condition == nullptr) return share(loop);
  struct Context {
    Loop& loop;
    StopCondition* condition;
  } context{loop, condition};
  const auto call = [](void* work, int task, int slot) {
    const Context& in = *static_cast<const Context*>(work);
    const StopCondition::Shared shared(in.condition);
    in.condition->throw_if_met();
    in.loop.call(in.loop.work, task, slot);
  };
  Loop stoppable{call, &context, loop.count};
  share(stoppable);
}

void ThreadPool::share(Loop& loop) {
  if (loop.count <= 1 || helpers_.empty()) {
    for (int task = 0; task < loop.count; ++task) loop.call(loop.work, task, my_slot());
    return;
  }
  publish(loop);
  run_tasks(loop, my_slot());
  withdraw(loop);
  if (loop.failure) std::rethrow_exception(loop.failure);
}

void ThreadPool::run_tasks(Loop& loop, int slot) {
  for (int task = loop.next_task++; task < loop.count; task = loop.next_task++) {
    try {
      loop.call(loop.work, task, slot);
    } catch (...) {
      const std::scoped_lock lock(mutex_);
      // Tasks start in order, so all lower ones have begun and will report their errors.
      if (!loop.failure || task < loop.failed_task) {
        loop.failure = std::current_exception();
        loop.failed_task = task;
      }
      loop.next_task = loop.count;
    }
  }
}

void ThreadPool::publish(Loop& loop) {
  {
    const std::scoped_lock lock(mutex_);
    open_.push_back(&loop);
  }
  ++news_;
  // This costs nothing while nobody sleeps.
  for (int i = 1; i < std::min(loop.count, threads()); ++i) news_.notify_one();
}

/// Lets no more helpers join, and waits for those inside.
void ThreadPool::withdraw(Loop& loop) {
  {
    const std::scoped_lock lock(mutex_);
    open_.erase(std::find(open_.begin(), open_.end(), &loop));
  }
  const auto is_left = [&] { return loop.helpers == 0; };
  while (!watch(is_left)) {
    const int seen = departures_;
    if (!is_left()) departures_.wait(seen);
  }
}

ThreadPool::Loop* ThreadPool::join_oldest() {
  const std::scoped_lock lock(mutex_);
  for (Loop* loop : open_)
    if (loop->next_task < loop->count) {
      ++loop->helpers;
      return loop;
    }
  return nullptr;
}

void ThreadPool::leave(Loop& loop) {
  // This is the last touch of the loop, because its thread may return at once.
  if (--loop.helpers > 0) return;
  ++departures_;
  departures_.notify_all();
}

void ThreadPool::wait_for_news(int seen) {
  if (!watch([&] { return news_ != seen; })) news_.wait(seen);
}

void ThreadPool::help(int slot) {
  my_membership = {this, slot};
  for (;;) {
    const int seen = news_;
    if (is_ending_) return;
    if (Loop* loop = join_oldest(); loop != nullptr) {
      run_tasks(*loop, slot);
      leave(*loop);
    } else {
      wait_for_news(seen);
    }
  }
}

}  // namespace af
