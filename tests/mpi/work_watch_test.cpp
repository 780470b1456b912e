// SPDX-License-Identifier: Apache-2.0
#include "parallel/work_watch.h"

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace af {
namespace {

using testing::HasSubstr;

constexpr double kLimitMinutes = 0.4 / 60.0;
constexpr double kLongLimitMinutes = 1.0 / 60.0;  // many steps, on a busy machine, too
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

TEST(WorkWatch, NamesTheRankThatIsStuckNotThoseThatWaitForIt) {
  const Communicator world = Communicator::world();
  const Communicator node = world.node();
  const int stuck = world.size() - 1;
  std::atomic<int> reports = 0;
  std::string said;
  {
    const StallWatch watch(world, kLongLimitMinutes, [&](const std::string& message) {
      said = message;
      ++reports;
    });
    const WorkNote note("unit " + std::to_string(world.rank()));
    if (world.rank() == stuck) std::this_thread::sleep_for(2 * kSteps * kStep);
    world.barrier();
  }
  const bool is_host_of_stuck = sum_on_host(node, world.rank() == stuck ? 1 : 0) == 1;
  const std::uint64_t reports_of_host = sum_on_host(node, static_cast<std::uint64_t>(reports));
  if (is_host_of_stuck) {
    EXPECT_EQ(reports_of_host, 1u);
  } else {  // The job, which would have ended, goes on here: then the other hosts speak up, too.
    EXPECT_LE(reports_of_host, 1u);
  }
  if (reports == 0) return;
  const std::string number = std::to_string(stuck);
  if (is_host_of_stuck) {
    EXPECT_THAT(said, HasSubstr("rank " + number + " on " + host_name()));
    EXPECT_THAT(said, HasSubstr("unit " + number + ": no progress for 0.0"));
  } else {
    EXPECT_THAT(said, HasSubstr("all ranks on " + host_name()));
    EXPECT_THAT(said, HasSubstr("waiting for others"));
  }
}

TEST(WorkWatch, IsSilentWhileEverybodyMakesProgress) {
  const Communicator world = Communicator::world();
  std::atomic<int> reports = 0;
  std::string said;
  {
    const StallWatch watch(world, kLongLimitMinutes, [&](const std::string& message) {
      said = message;
      ++reports;
    });
    const WorkNote note("many steps");
    for (int i = 0; i < kSteps; ++i) {
      std::this_thread::sleep_for(kStep);
      note_progress();
    }
    // Waiting for others, who work, is no stall either.
    if (world.is_root())
      for (int i = 0; i < kSteps / 2; ++i) {
        std::this_thread::sleep_for(kStep);
        note_progress();
      }
    world.barrier();
  }
  EXPECT_EQ(reports, 0) << said;
}

TEST(WorkWatch, NamesARankThatIsStoppedAlsoWhileItWaits) {
  const Communicator world = Communicator::world();
  const Communicator node = world.node();
  if (node.size() == 1) GTEST_SKIP() << "needs a rank that watches another";
  const bool is_stopped = node.rank() == node.size() - 1;
  const auto stopped =
      static_cast<pid_t>(sum_on_host(node, is_stopped ? static_cast<std::uint64_t>(getpid()) : 0));
  std::atomic<int> reports = 0;
  std::string said;
  {
    const StallWatch watch(world, kLimitMinutes, [&](const std::string& message) {
      said = message;
      ++reports;
    });
    world.barrier();
    const WaitNote waits;
    if (node.rank() == 0) {
      ASSERT_EQ(kill(stopped, SIGSTOP), 0);
      std::this_thread::sleep_for(kSteps * kStep);
      ASSERT_EQ(kill(stopped, SIGCONT), 0);
    }
    world.barrier();
  }
  EXPECT_EQ(sum_on_host(node, static_cast<std::uint64_t>(reports)), 1u);
  if (reports == 0) return;
  EXPECT_THAT(said,
              HasSubstr("(process " + std::to_string(stopped) + "): is stopped: has not run"));
}

TEST(WorkWatch, KeepsTheLimitOfANoteWhenOneWithinEnds) {
  const Communicator world = Communicator::world();
  std::atomic<int> reports = 0;
  {
    const StallWatch watch(world, 10.0 * kLongLimitMinutes, [&](const std::string&) { ++reports; });
    const WorkNote note("testing", WorkNote::Kind::Phase, kLimitMinutes);
    { const WorkNote within("a step"); }
    std::this_thread::sleep_for(kSteps / 2 * kStep);
    world.barrier();
  }
  EXPECT_EQ(sum_on_host(world.node(), static_cast<std::uint64_t>(reports)), 1u);
}

TEST(WorkWatch, SaysWhenAllRanksOfAHostWaitForOthers) {
  const Communicator world = Communicator::world();
  std::atomic<int> reports = 0;
  std::string said;
  {
    const StallWatch watch(world, kLimitMinutes, [&](const std::string& message) {
      said = message;
      ++reports;
    });
    const WorkNote note("training");
    const WaitNote waits;
    std::this_thread::sleep_for(kSteps * kStep);
  }
  EXPECT_EQ(sum_on_host(world.node(), static_cast<std::uint64_t>(reports)), 1u);
  if (reports > 0) {
    EXPECT_THAT(said, HasSubstr("all ranks on " + host_name() + ": training: waiting for others"));
  }
}

}  // namespace
}  // namespace af
