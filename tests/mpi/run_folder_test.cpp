// SPDX-License-Identifier: Apache-2.0
#include "ranks/run_folder.h"

#include <array>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "ranks/resumable_items.h"
#include "support/shared_folder.h"

namespace af {
namespace {

const DecidingValues kDecides = {{"seed", "1"}};

RunOutput output_in(const test::SharedFolder& folder, bool restarts = false) {
  return {folder / "out", {"table.csv", "reproduce.sh", "summary.json"}, restarts};
}

Provenance some_provenance() {
  return {"af-test", "af-test --fast", "fast = true\n", 3, Communicator::world().size(), {}};
}

/// Whether the path exists for rank 0. Every rank gets the answer.
bool is_there(const std::filesystem::path& path) {
  const Communicator world = Communicator::world();
  std::array<std::uint64_t, 1> found{world.is_root() && std::filesystem::exists(path) ? 1U : 0U};
  world.maximum(found);
  return found[0] != 0;
}

std::vector<std::byte> result_of(std::int64_t item) {
  return {static_cast<std::byte>(item)};
}

/// Does five items in OUT.progress. Returns how many of them earlier runs had not done.
std::uint64_t done_in(const RunFolder& run, const DecidingValues& decides = kDecides) {
  const Communicator world = Communicator::world();
  ResumableItems items(run.unfinished("rows", decides), world);
  std::array<std::uint64_t, 1> done{};
  items.complete({0, 1, 2, 3, 4}, "", [&](std::int64_t item) {
    ++done[0];
    return result_of(item);
  });
  world.sum(done);
  return done[0];
}

TEST(RunFolder, LeavesNothingUntilItIsOpenedAndWritesTheSummaryLast) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  {
    RunFolder run(output_in(folder), world);
    EXPECT_FALSE(is_there(folder / "out"));
    run.open();
    EXPECT_TRUE(is_there(folder / "out.lock"));
    EXPECT_EQ(done_in(run), 5u);
    EXPECT_TRUE(is_there(folder / "out.progress"));
    EXPECT_FALSE(is_there(folder / "out" / "summary.json"));
    world.barrier();
    if (world.is_root()) run.finish({{"rows", 5}}, some_provenance());
    EXPECT_TRUE(is_there(folder / "out" / "summary.json"));
    EXPECT_TRUE(is_there(folder / "out" / "reproduce.sh"));
    EXPECT_FALSE(is_there(folder / "out.progress"));
  }
  world.barrier();
  EXPECT_FALSE(is_there(folder / "out.lock"));
  if (world.is_root()) {
    const nlohmann::json summary =
        nlohmann::json::parse(std::ifstream(folder / "out" / "summary.json"));
    EXPECT_EQ(summary["rows"], 5);
    EXPECT_EQ(summary["provenance"]["command_line"], "af-test --fast");
  }
}

TEST(RunFolder, AnEarlierSummaryIsGoneWhenNewResultsBeginAndForeignFilesStay) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  if (world.is_root()) {
    std::filesystem::create_directories(folder / "out");
    for (const char* name : {"summary.json", "notes.txt"})
      std::ofstream(folder / "out" / name) << "{}";
  }
  world.barrier();
  RunFolder run(output_in(folder), world);
  run.open();
  EXPECT_TRUE(is_there(folder / "out" / "summary.json"));
  world.barrier();
  if (world.is_root()) run.begin_results();
  EXPECT_FALSE(is_there(folder / "out" / "summary.json"));
  if (world.is_root()) run.finish({}, some_provenance());
  EXPECT_TRUE(is_there(folder / "out" / "summary.json"));
  EXPECT_TRUE(is_there(folder / "out" / "notes.txt"));
}

TEST(RunFolder, ASecondRunIsRefusedOnEveryRankAndLeavesTheFirstItsProgress) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  RunFolder first(output_in(folder), world);
  first.open();
  EXPECT_EQ(done_in(first), 5u);
  RunFolder second(output_in(folder, true), world);
  try {
    second.open();
    ADD_FAILURE() << "opened on rank " << world.rank();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::Input);
    EXPECT_THAT(error.what(), testing::HasSubstr("another job is writing it"));
  }
  EXPECT_EQ(done_in(first), 0u);
}

TEST(RunFolder, OtherOptionsAreRefusedUntilRestarted) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  const DecidingValues other = {{"seed", "2"}};
  {
    RunFolder run(output_in(folder), world);
    run.open();
    EXPECT_EQ(done_in(run), 5u);
    EXPECT_THROW(done_in(run, other), Error);
  }
  world.barrier();
  RunFolder restarted(output_in(folder, true), world);
  restarted.open();
  EXPECT_EQ(done_in(restarted, other), 5u);
}

TEST(RunFolder, RestartKeepsWhatIsThereUntilTheWorkBegins) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  {
    RunFolder run(output_in(folder), world);
    run.open();
    EXPECT_EQ(done_in(run), 5u);
  }
  world.barrier();
  {
    // A run whose inputs turn out to be bad comes no further than this.
    RunFolder restarted(output_in(folder, true), world);
    restarted.open();
  }
  world.barrier();
  RunFolder again(output_in(folder), world);
  again.open();
  EXPECT_EQ(done_in(again), 0u);
}

TEST(RunFolder, RestartThrowsAwayWhateverHasTheNameOfUnfinishedWork) {
  const Communicator world = Communicator::world();
  using std::filesystem::create_directories;
  const test::SharedFolder folder;
  const std::filesystem::path progress = folder / "out.progress";
  const std::vector<std::function<void()>> damages = {
      [&] { std::ofstream(progress) << "a file"; },
      [&] { create_directories(progress / "rows.json" / "full"); },
      [&] {
        create_directories(progress);
        std::ofstream(progress / "rows.json") << "{";
      }};
  for (const auto& damage : damages) {
    if (world.is_root()) damage();
    world.barrier();
    {
      RunFolder run(output_in(folder), world);
      run.open();
      EXPECT_THROW(done_in(run), Error);
    }
    world.barrier();
    RunFolder restarted(output_in(folder, true), world);
    restarted.open();
    EXPECT_EQ(done_in(restarted), 5u);
    world.barrier();
    if (world.is_root()) restarted.finish();
    world.barrier();
  }
}

TEST(RunFolder, AnOutputThatCannotBeMadeIsRefusedOnEveryRank) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  if (world.is_root()) std::ofstream(folder / "out") << "a file";
  world.barrier();
  EXPECT_THROW(RunFolder(output_in(folder), world), Error);
  RunFolder file({folder / "out" / "field.h5", {}}, world);
  EXPECT_THROW(file.open(), Error);
}

// Last: a stop request cannot be taken back.
TEST(RunFolder, AStopInTheMidstIsGoneOnWith) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  RunFolder run(output_in(folder), world);
  RunFolder without({folder / "field.h5", {}, false, false}, world);
  run.open();
  run.stop_if_requested("too early");
  EXPECT_EQ(done_in(run), 5u);
  if (world.rank() == world.size() - 1) std::raise(SIGUSR1);
  EXPECT_THROW(run.stop_if_requested("with five rows saved"), Error);
  EXPECT_EQ(run.is_stop_requested(), world.rank() == world.size() - 1);
  EXPECT_FALSE(without.is_stop_requested());
  without.stop_if_requested("never");
  ResumableItems items(run.unfinished("rows", kDecides), world);
  try {
    items.complete({0, 1, 2, 3, 4, 5}, "rows", result_of);
    ADD_FAILURE() << "not stopped on rank " << world.rank();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::Stopped);
    EXPECT_THAT(error.what(), testing::ContainsRegex("[56] of 6 saved"));
  }
}

}  // namespace
}  // namespace af
