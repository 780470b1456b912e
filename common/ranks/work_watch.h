// SPDX-License-Identifier: Apache-2.0
// What every rank is doing, for messages and for the watchdog.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "ranks/communicator.h"

namespace af {

/// "casting unit 17 of 96": what this rank works on as long as the note lives. Notes nest, and the
/// innermost counts. An exception that passes a unit's note is reported with the note's text
/// (failure_of()). One that passes only a phase's note is not.
class WorkNote {
 public:
  enum class Kind { Phase, Unit };

  /// `limit_minutes`: the watchdog's limit for this note, when it is less than the watchdog's own.
  /// An inner note without a limit shares this limit, and is reported under this note's text.
  explicit WorkNote(const std::string& what, Kind kind = Kind::Unit, double limit_minutes = 0.0);
  ~WorkNote();
  WorkNote(const WorkNote&) = delete;
  WorkNote& operator=(const WorkNote&) = delete;

  /// The next unit of the same kind.
  void change(const std::string& what);

 private:
  std::string what_;
  std::string before_;
  Kind kind_;
  int exceptions_;
  std::int64_t limit_before_ns_;
  bool limit_is_of_outer_;
};

/// Notes that a long unit has made progress.
void note_progress();

/// While the note lives, this rank is in a call that waits for other ranks. If that takes long,
/// other ranks are stuck.
class WaitNote {
 public:
  WaitNote();
  ~WaitNote();
  WaitNote(const WaitNote&) = delete;
  WaitNote& operator=(const WaitNote&) = delete;

 private:
  std::int64_t before_;
};

/// The unit that the exception just caught in this thread has left. Returned once; empty when there
/// is none.
std::string take_failed_unit();

/// Whether this rank reports why the job ends. That is the first of its host to ask, if there is a
/// StallWatch.
bool claim_report();

/// Calls `on_end`, which must end the process, when it lives for longer than a limit. It covers the
/// moments in which ranks wait for each other and no StallWatch sees them: while that one is made
/// and destroyed, and while MPI ends. Time for which the whole job is stopped does not count.
/// \test Faults.ARankThatIsStoppedWhileOthersEndDoesNotKeepTheJob
class WaitAlarm {
 public:
  WaitAlarm(double limit_minutes, std::function<void()> on_end);
  ~WaitAlarm();
  WaitAlarm(const WaitAlarm&) = delete;
  WaitAlarm& operator=(const WaitAlarm&) = delete;

 private:
  std::atomic<bool> is_over_ = false;
  std::thread thread_;
};

/// Watches the ranks of every host from a thread of each rank. When a rank makes no progress, for
/// whatever reason (it computes for ever, hangs in the file system, is stopped), `on_stall` is
/// called on one rank of its host, with a text that names rank, host and unit. It must end the job.
/// When a process is stopped, its own watching thread stands still too, but the other ranks of its
/// host find it, even if it was waiting.
/// \test WorkWatch.NamesTheRankThatIsStuckNotThoseThatWaitForIt
class StallWatch {
 public:
  using OnStall = std::function<void(const std::string& message)>;

  /// Collective.
  StallWatch(const Communicator& communicator, double limit_minutes, OnStall on_stall);
  /// Collective.
  ~StallWatch();
  StallWatch(const StallWatch&) = delete;
  StallWatch& operator=(const StallWatch&) = delete;

 private:
  struct Board;
  struct Stuck;
  void watch(const std::stop_token& is_over);
  [[nodiscard]] std::optional<Stuck> longest_stuck(std::int64_t now,
                                                   std::int64_t watched_since_ns) const;
  [[nodiscard]] std::int64_t all_wait_ns(std::int64_t now, std::int64_t watched_since_ns) const;
  [[nodiscard]] std::string stall_text(std::int64_t now, std::int64_t watched_since_ns) const;

  std::unique_ptr<Board> board_;
  std::int64_t limit_ns_;
  OnStall on_stall_;
  std::jthread thread_;
};

}  // namespace af
