// SPDX-License-Identifier: Apache-2.0
#include "ranks/work_watch.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <limits>
#include <mutex>
#include <new>
#include <span>
#include <sstream>
#include <string_view>
#include <unistd.h>
#include <utility>

#include "base/host_name.h"

namespace af {

namespace {

/// Text that is written and read letter by letter, without a lock. It serves messages only, so a
/// text that is half old and half new does no harm.
class SharedText {
 public:
  void set(std::string_view text) {
    const std::size_t size = std::min(text.size(), letters_.size());
    for (std::size_t i = 0; i < size; ++i) letters_[i].store(text[i], std::memory_order_relaxed);
    if (size < letters_.size()) letters_[size].store('\0', std::memory_order_relaxed);
  }
  [[nodiscard]] std::string get() const {
    std::string text;
    for (const std::atomic<char>& letter : letters_) {
      const char read = letter.load(std::memory_order_relaxed);
      if (read == '\0') break;
      text.push_back(read);
    }
    return text;
  }

 private:
  std::array<std::atomic<char>, 255> letters_{};
};

/// What one rank is doing. The others of its host see it.
struct RankNote {
  std::atomic<std::int64_t> since_ns = 0;  ///< the last progress; 0: nothing in work
  std::atomic<std::int64_t> limit_ns = 0;  ///< limit for what is in work; 0: the watchdog's own
  std::atomic<std::int64_t> waits_since_ns =
      0;  ///< when it began to wait for others in a call; 0: it does not
  std::atomic<std::int64_t> ticked_ns = 0;  ///< when its own watchdog last ran; 0: not watched
  std::int32_t rank = 0;
  std::int32_t process = 0;
  std::atomic<bool> has_reported = false;  ///< the first rank of a host has said why the job ends
  SharedText what;
};
static_assert(std::atomic<std::int64_t>::is_always_lock_free, "shared between processes");
static_assert(std::atomic<char>::is_always_lock_free, "shared between processes");

RankNote own_note;
std::atomic<RankNote*> my_note = &own_note;
std::atomic<RankNote*> first_note = &own_note;  ///< the first note of this host
std::mutex text_mutex;                          ///< rank 0 computes in a second thread
std::string text_now;
thread_local std::string failed_unit;

/// A clock that all processes of a host share.
std::int64_t now_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

/// Replaces the text; returns the one before.
std::string set_text(const std::string& what) {
  RankNote& note = *my_note;
  const std::scoped_lock lock(text_mutex);
  note.what.set(what);
  note.since_ns = what.empty() ? 0 : now_ns();
  return std::exchange(text_now, what);
}

constexpr double kNsPerMinute = 60e9;

// In limits. A thread of a busy machine may be late, but not by as much as this. When no rank of a
// host works, the host of the stuck rank has had the time to report it.
constexpr std::int64_t kPatienceWithStopped = 2;
constexpr std::int64_t kPatienceWithHosts = 3;

/// Limits more than a year to a year.
std::int64_t nanoseconds_of(double minutes) {
  constexpr double kMinutesPerYear = 525600.0;
  return static_cast<std::int64_t>(std::min(minutes, kMinutesPerYear) * kNsPerMinute);
}

std::string minutes_text(std::int64_t ns) {
  std::ostringstream text;
  text.precision(3);
  text << static_cast<double>(ns) / kNsPerMinute << " min";
  return text.str();
}

}  // namespace

WorkNote::WorkNote(const std::string& what, Kind kind, double limit_minutes)
    : what_(what),
      kind_(kind),
      exceptions_(std::uncaught_exceptions()),
      limit_before_ns_((*my_note).limit_ns),
      limit_is_of_outer_(limit_before_ns_ != 0 && limit_minutes == 0.0) {
  failed_unit.clear();
  before_ = set_text(what);
  if (limit_is_of_outer_)
    set_text(before_ + ": " + what);
  else
    (*my_note).limit_ns = nanoseconds_of(limit_minutes);
}

WorkNote::~WorkNote() {
  const bool is_leaving_by_exception = std::uncaught_exceptions() > exceptions_;
  if (!is_leaving_by_exception)
    failed_unit.clear();
  else if (kind_ == Kind::Unit && failed_unit.empty())
    failed_unit = what_;
  set_text(before_);
  (*my_note).limit_ns = limit_before_ns_;
}

void WorkNote::change(const std::string& what) {
  what_ = what;
  set_text(limit_is_of_outer_ ? before_ + ": " + what : what);
}

void note_progress() {
  RankNote& note = *my_note;
  std::int64_t since_ns = note.since_ns;
  // Another thread may end the work meanwhile. It must not begin again then.
  while (since_ns != 0 && !note.since_ns.compare_exchange_weak(since_ns, now_ns())) {
  }
}

WaitNote::WaitNote() : before_((*my_note).waits_since_ns) {
  if (before_ == 0) (*my_note).waits_since_ns = now_ns();
}

WaitNote::~WaitNote() {
  note_progress();  // first: a rank that has stopped waiting must not look as if it had worked
                    // since
  (*my_note).waits_since_ns = before_;
}

std::string take_failed_unit() {
  return std::exchange(failed_unit, {});
}

bool claim_report() {
  return !(*first_note).has_reported.exchange(true);
}

/// The notes of the ranks of this host.
struct StallWatch::Board {
  std::shared_ptr<const std::byte> memory;
  std::span<RankNote> notes;
};

struct StallWatch::Stuck {
  const RankNote* note;
  std::int64_t ns;
  bool is_stopped;
};

WaitAlarm::WaitAlarm(double limit_minutes, std::function<void()> on_end)
    : thread_([this, limit_minutes, on_end = std::move(on_end)] {
        constexpr std::chrono::milliseconds kTick(10);
        const std::int64_t ticks = nanoseconds_of(limit_minutes) / 10'000'000 + 1;
        for (std::int64_t i = 0; i < ticks; ++i) {
          if (is_over_) return;
          std::this_thread::sleep_for(kTick);
        }
        if (!is_over_) on_end();
      }) {}

WaitAlarm::~WaitAlarm() {
  is_over_ = true;
  thread_.join();
}

StallWatch::StallWatch(const Communicator& communicator, double limit_minutes, OnStall on_stall)
    : board_(std::make_unique<Board>()),
      limit_ns_(nanoseconds_of(limit_minutes)),
      on_stall_(std::move(on_stall)) {
  const Communicator node = communicator.node();
  const auto ranks = static_cast<std::size_t>(node.size());
  RankNote* notes = nullptr;
  board_->memory = communicator.allocate_on_node_together(
      ranks * sizeof(RankNote), [&](std::span<std::byte> bytes, int part, int) {
        notes = reinterpret_cast<RankNote*>(bytes.data());
        auto* const mine = new (notes + part) RankNote;
        mine->rank = communicator.rank();
        mine->process = getpid();
      });
  board_->notes = {notes, ranks};
  my_note = notes + node.rank();
  first_note = notes;
  set_text(set_text({}));
  (*my_note).ticked_ns = now_ns();
  thread_ = std::jthread([this](const std::stop_token& is_over) { watch(is_over); });
}

StallWatch::~StallWatch() {
  thread_.request_stop();
  thread_.join();
  my_note = &own_note;
  first_note = &own_note;
}

void StallWatch::watch(const std::stop_token& is_over) {
  constexpr std::int64_t kShortestTickNs = 10'000'000;
  constexpr std::int64_t kLongestTickNs = 200'000'000;
  const std::chrono::nanoseconds to_tick(
      std::clamp(limit_ns_ / 20, kShortestTickNs, kLongestTickNs));
  std::int64_t last_tick_ns = now_ns();
  std::int64_t watched_since_ns = last_tick_ns;
  std::mutex own;
  std::unique_lock lock(own);
  std::condition_variable_any ended;  // the end wakes it: a program does not wait for a tick
  while (!ended.wait_for(lock, is_over, to_tick, [&] { return is_over.stop_requested(); })) {
    const std::int64_t tick = now_ns();
    // A batch system may stop and continue whole jobs. That time does not count.
    if (tick - last_tick_ns > limit_ns_ / 2) watched_since_ns = tick;
    last_tick_ns = tick;
    (*my_note).ticked_ns = tick;
    const std::string text = stall_text(tick, watched_since_ns);
    if (!text.empty() && claim_report()) on_stall_(text);
  }
  (*my_note).ticked_ns = 0;
}

// `now` is the time of the tick. A later reading would include time for which the job was stopped
// in between.

/// The rank that has been stuck for longest: busy with one thing for too long without waiting, or
/// not running at all (stopped), wherever it was then.
std::optional<StallWatch::Stuck> StallWatch::longest_stuck(std::int64_t now,
                                                           std::int64_t watched_since_ns) const {
  const auto age_of = [&](std::int64_t since_ns) {
    return since_ns == 0 ? 0 : now - std::max(since_ns, watched_since_ns);
  };
  std::optional<Stuck> longest;
  for (const RankNote& note : board_->notes) {
    const std::int64_t own_limit = note.limit_ns;
    const std::int64_t limit = own_limit == 0 ? limit_ns_ : std::min(own_limit, limit_ns_);
    // A waiting rank is not stuck. A busy machine also makes a thread wait, but not for as long as
    // this.
    const std::int64_t works_ns = note.waits_since_ns != 0 ? 0 : age_of(note.since_ns);
    const std::int64_t still_ns = age_of(note.ticked_ns);
    const bool is_stopped = still_ns > kPatienceWithStopped * limit_ns_;
    if (works_ns <= limit && !is_stopped) continue;
    const std::int64_t ns = is_stopped ? still_ns : works_ns;
    if (!longest || ns > longest->ns) longest = Stuck{&note, ns, is_stopped};
  }
  return longest;
}

/// How long all ranks of this host have been waiting for others; 0 when one of them works.
std::int64_t StallWatch::all_wait_ns(std::int64_t now, std::int64_t watched_since_ns) const {
  std::int64_t shortest = std::numeric_limits<std::int64_t>::max();
  for (const RankNote& note : board_->notes) {
    const std::int64_t since = note.waits_since_ns;
    shortest = std::min(shortest, since == 0 ? 0 : now - std::max(since, watched_since_ns));
  }
  return shortest;
}

std::string StallWatch::stall_text(std::int64_t now, std::int64_t watched_since_ns) const {
  const auto at = [](const RankNote& note) {
    const std::string what = note.what.get();
    return what.empty() ? what : ": " + what;
  };
  if (const std::optional<Stuck> stuck = longest_stuck(now, watched_since_ns))
    return "rank " + std::to_string(stuck->note->rank) + " on " + host_name() + " (process " +
           std::to_string(stuck->note->process) + ")" + at(*stuck->note) +
           (stuck->is_stopped ? ": is stopped: has not run for " : ": no progress for ") +
           minutes_text(stuck->ns);
  const std::int64_t waited_ns = all_wait_ns(now, watched_since_ns);
  if (waited_ns <= kPatienceWithHosts * limit_ns_) return {};
  return "all ranks on " + host_name() + at(board_->notes[0]) + ": waiting for others for " +
         minutes_text(waited_ns);
}

}  // namespace af
