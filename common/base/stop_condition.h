// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

namespace af {

/// A condition for ending loops early. While it lives, the loops that its thread starts in a
/// ThreadPool, and those nested in their tasks, ask it about ten times a second, and only on its
/// thread. When it is met they throw StoppedError. \test StopCondition.EndsALoopOnAllItsThreads
class StopCondition {
 public:
  explicit StopCondition(std::function<bool()> is_met);
  ~StopCondition();
  StopCondition(const StopCondition&) = delete;
  StopCondition& operator=(const StopCondition&) = delete;

  /// The condition of the running thread, or of the loop in which it helps; null when there is
  /// none.
  static StopCondition* current();
  void throw_if_met();

  /// Lets a thread that helps in a loop use the loop's condition, which may be null.
  class Shared {
   public:
    explicit Shared(StopCondition* condition);
    ~Shared();
    Shared(const Shared&) = delete;
    Shared& operator=(const Shared&) = delete;

   private:
    StopCondition* outer_;
  };

 private:
  std::function<bool()> ask_;
  std::thread::id owner_ = std::this_thread::get_id();
  std::chrono::steady_clock::time_point next_time_;  ///< when to ask next
  std::atomic<bool> is_met_ = false;
  Shared shared_;
};

/// Throws StoppedError when the thread's condition, if there is one, is met.
inline void throw_if_stopped() {
  if (StopCondition* const condition = StopCondition::current(); condition != nullptr)
    condition->throw_if_met();
}

}  // namespace af
