// SPDX-License-Identifier: Apache-2.0
#include "base/stop_condition.h"

#include <utility>

#include "base/error.h"

namespace af {
namespace {

using Clock = std::chrono::steady_clock;

/// A condition may have to wait for a lock of its language, so it is not asked more often.
constexpr std::chrono::milliseconds kTimeBetweenQuestions{100};

thread_local StopCondition* of_this_thread = nullptr;

}  // namespace

StopCondition::Shared::Shared(StopCondition* condition)
    : outer_(std::exchange(of_this_thread, condition)) {}

StopCondition::Shared::~Shared() {
  of_this_thread = outer_;
}

StopCondition::StopCondition(std::function<bool()> is_met)
    : ask_(std::move(is_met)), next_time_(Clock::now() + kTimeBetweenQuestions), shared_(this) {}

StopCondition::~StopCondition() = default;

StopCondition* StopCondition::current() {
  return of_this_thread;
}

void StopCondition::throw_if_met() {
  if (!is_met_ && std::this_thread::get_id() == owner_ && Clock::now() >= next_time_) {
    is_met_ = ask_();
    next_time_ = Clock::now() + kTimeBetweenQuestions;
  }
  if (is_met_) throw StoppedError("stopped on request");
}

}  // namespace af
