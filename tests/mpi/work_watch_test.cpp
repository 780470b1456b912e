// SPDX-License-Identifier: Apache-2.0
#include "ranks/work_watch.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <span>
#include <string>
#include <thread>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/host_name.h"

namespace af {
namespace {

using testing::HasSubstr;

constexpr double kLimitMinutes = 0.4 / 60.0;
constexpr double kLongLimitMinutes = 1.0 / 60.0;  // many steps, even on a busy machine
constexpr std::chrono::milliseconds kStep{50};
constexpr int kSteps = 40;  // well above any limit here

TEST(WorkNote, NamesTheUnitThatAnErrorCameFrom) {
  const Communicator world = Communicator::world();
  try {
    all_or_none(world, [&] {
      const WorkNote phase("reading", WorkNote::Kind::Phase);
      if (!world.is_root()) return;
      const WorkNote unit("unit 7 of 9");
      throw FileError("a.h5", "is torn");
    });
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("unit 7 of 9: a.h5: is torn"));
    EXPECT_EQ(std::string(error.what()).find("reading"), std::string::npos);
  }
  EXPECT_EQ(take_failed_unit(), "");
}

TEST(WorkNote, IsNotBlamedForAnErrorThatWasHandledOrCameLater) {
  const auto failing_unit = [] {
    const WorkNote unit("unit 1");
    throw NumericError("no");
  };
  try {
    failing_unit();
  } catch (const Error&) {  // handled: the work goes on
  }
  { const WorkNote unit("unit 2"); }
  try {
    throw NumericError("later");
  } catch (...) {
    EXPECT_EQ(failure_of(std::current_exception()).message, "later");
  }
}

/// Collective. The sum over the ranks of this host.
std::uint64_t sum_on_host(const Communicator& node, std::uint64_t value) {
  std::array<std::uint64_t, 1> all{value};
  node.sum(all);
  return all[0];
}

/// Counts what watchdogs say where all ranks of a host see it. Tests wait for that, however long it
/// takes on a busy machine.
class Reports {
 public:
  /// Collective.
  explicit Reports(const Communicator& world)
      : memory_(world.allocate_on_node(
            sizeof(std::atomic<int>),
            [](std::span<std::byte> bytes) { new (bytes.data()) std::atomic<int>(0); })),
        of_host_(const_cast<std::atomic<int>*>(
            reinterpret_cast<const std::atomic<int>*>(memory_.get()))) {}

  StallWatch::OnStall add() {
    return [this](const std::string& message) {
      said_ = message;
      ++*of_host_;
    };
  }
  [[nodiscard]] int of_host() const { return *of_host_; }
  /// What this rank's watchdog said, empty when another spoke. To be read once the watchdog is
  /// gone.
  [[nodiscard]] const std::string& said() const { return said_; }

  void wait_for_one() const {
    const auto deadline = std::chrono::steady_clock::now() + kLongest;
    while (of_host() == 0 && std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(kStep);
  }

 private:
  static constexpr std::chrono::seconds kLongest{60};
  std::shared_ptr<const std::byte> memory_;
  std::atomic<int>* of_host_;
  std::string said_;
};

TEST(WorkWatch, NamesTheRankThatIsStuckNotThoseThatWaitForIt) {
  const Communicator world = Communicator::world();
  const Communicator node = world.node();
  const int stuck = world.size() - 1;
  Reports reports(world);
  {
    const StallWatch watch(world, kLongLimitMinutes, reports.add());
    const WorkNote note("unit " + std::to_string(world.rank()));
    if (world.rank() == stuck) reports.wait_for_one();
    world.barrier();
  }
  const bool is_host_of_stuck = sum_on_host(node, world.rank() == stuck ? 1 : 0) == 1;
  if (is_host_of_stuck) {
    EXPECT_EQ(reports.of_host(), 1);
  } else {  // Here the job goes on instead of ending, so the other hosts may report, too.
    EXPECT_LE(reports.of_host(), 1);
  }
  if (reports.said().empty()) return;
  const std::string number = std::to_string(stuck);
  if (is_host_of_stuck) {
    EXPECT_THAT(reports.said(), HasSubstr("rank " + number + " on " + host_name()));
    EXPECT_THAT(reports.said(), HasSubstr("unit " + number + ": no progress for 0."));
  } else {
    EXPECT_THAT(reports.said(), HasSubstr("all ranks on " + host_name()));
    EXPECT_THAT(reports.said(), HasSubstr("waiting for others"));
  }
}

TEST(WorkWatch, IsSilentWhileEverybodyMakesProgress) {
  const Communicator world = Communicator::world();
  Reports reports(world);
  std::int64_t longest_ms = 0;
  {
    const StallWatch watch(world, kLongLimitMinutes, reports.add());
    const WorkNote note("many steps");
    const auto make_steps = [&](int count) {
      for (int i = 0; i < count; ++i) {
        const auto begin = std::chrono::steady_clock::now();
        std::this_thread::sleep_for(kStep);
        note_progress();
        longest_ms = std::max<std::int64_t>(
            longest_ms, (std::chrono::steady_clock::now() - begin) / std::chrono::milliseconds(1));
      }
    };
    make_steps(kSteps);
    // Waiting for others that work is no stall either.
    if (world.is_root()) make_steps(kSteps / 2);
    world.barrier();
  }
  std::array<std::uint64_t, 1> longest = {static_cast<std::uint64_t>(longest_ms)};
  world.maximum(longest);
  constexpr std::uint64_t kHalfOfLimitMs = 500;
  if (longest[0] > kHalfOfLimitMs)
    GTEST_SKIP() << "a busy machine: a step took " << longest[0] << " ms";
  EXPECT_EQ(reports.of_host(), 0) << reports.said();
}

TEST(WorkWatch, NamesARankThatIsStoppedAlsoWhileItWaits) {
  const Communicator world = Communicator::world();
  const Communicator node = world.node();
  if (node.size() == 1) GTEST_SKIP() << "needs a rank that watches another";
  const bool is_stopped = node.rank() == node.size() - 1;
  const auto stopped =
      static_cast<pid_t>(sum_on_host(node, is_stopped ? static_cast<std::uint64_t>(getpid()) : 0));
  Reports reports(world);
  {
    const StallWatch watch(world, kLimitMinutes, reports.add());
    world.barrier();
    const WaitNote waits;
    if (node.rank() == 0) {
      EXPECT_EQ(kill(stopped, SIGSTOP), 0);
      reports.wait_for_one();
      EXPECT_EQ(kill(stopped, SIGCONT), 0);
    }
    world.barrier();
  }
  EXPECT_EQ(reports.of_host(), 1);
  if (reports.said().empty()) return;
  EXPECT_THAT(reports.said(),
              HasSubstr("(process " + std::to_string(stopped) + "): is stopped: has not run"));
}

TEST(WorkWatch, KeepsTheLimitOfANoteBesideAndWithinOthers) {
  const Communicator world = Communicator::world();
  Reports reports(world);
  {
    constexpr double kTooLongMinutes = 60.0;
    const StallWatch watch(world, kTooLongMinutes, reports.add());
    const WorkNote note("testing", WorkNote::Kind::Phase, kLimitMinutes);
    { const WorkNote over("a step"); }
    const WorkNote within("another step");
    reports.wait_for_one();
    world.barrier();
  }
  EXPECT_EQ(reports.of_host(), 1);
  if (!reports.said().empty()) {
    EXPECT_THAT(reports.said(), HasSubstr(": testing: another step: no progress for"));
  }
}

TEST(WorkWatch, SaysWhenAllRanksOfAHostWaitForOthers) {
  const Communicator world = Communicator::world();
  Reports reports(world);
  {
    const StallWatch watch(world, kLimitMinutes, reports.add());
    const WorkNote note("training");
    const WaitNote waits;
    reports.wait_for_one();
  }
  EXPECT_EQ(reports.of_host(), 1);
  if (!reports.said().empty()) {
    EXPECT_THAT(reports.said(),
                HasSubstr("all ranks on " + host_name() + ": training: waiting for others"));
  }
}

}  // namespace
}  // namespace af
