// SPDX-License-Identifier: Apache-2.0
#include "io/output_lock.h"

#include <csignal>
#include <cstdlib>
#include <sys/wait.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "io/output_file.h"
#include "support/test_paths.h"

namespace af {
namespace {

using testing::HasSubstr;

/// What taking the lock says; empty when it is given.
std::string refusal(const std::filesystem::path& output) {
  try {
    const OutputLock lock(output);
    return {};
  } catch (const InputError& error) {
    return error.what();
  }
}

/// A process that takes the lock and is killed with it, as a job is.
LockHolder killed_with_lock(const std::filesystem::path& output) {
  const pid_t child = fork();
  if (child == 0) {
    const OutputLock lock(output);
    kill(getpid(), SIGKILL);
  }
  waitpid(child, nullptr, 0);
  return lock_holder_of(read_text_file(output.string() + ".lock")).value();
}

TEST(OutputLock, IsHeldByOneAndNamesIt) {
  const test::ScratchFolder folder;
  {
    const OutputLock lock(folder / "a.h5");
    const std::string said = refusal(folder / "a.h5");
    EXPECT_THAT(said, HasSubstr("another job writes it: process " + std::to_string(getpid())));
    EXPECT_THAT(said, HasSubstr("since 20"));
    EXPECT_EQ(refusal(folder / "b.h5"), "");
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "a.h5.lock"));
  EXPECT_EQ(refusal(folder / "a.h5"), "");
}

TEST(OutputLock, OfAFolderStandsBesideIt) {
  const test::ScratchFolder folder;
  const OutputLock lock((folder / "results").string() + "/");
  EXPECT_TRUE(std::filesystem::exists(folder / "results.lock"));
  EXPECT_NE(refusal(folder / "results"), "");
}

TEST(OutputLock, OfAKilledProcessIsTakenOver) {
  const test::ScratchFolder folder;
  const LockHolder killed = killed_with_lock(folder / "a.h5");
  EXPECT_NE(killed.process, getpid());
  EXPECT_EQ(refusal(folder / "a.h5"), "");
}

TEST(OutputLock, ThatNobodyWroteItsNameIntoIsTakenOverWhereTheKernelKnows) {
  const test::ScratchFolder folder;
  write_text_file(folder / "a.h5.lock", "");
  EXPECT_EQ(refusal(folder / "a.h5"), "");
}

TEST(OutputLock, HolderReadsBackAndNothingElseDoes) {
  LockHolder holder = this_process();
  holder.job = "slurm 12_3";
  const auto read = lock_holder_of(to_json(holder));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->host, holder.host);
  EXPECT_EQ(read->process, getpid());
  EXPECT_EQ(read->process_start, holder.process_start);
  EXPECT_EQ(read->job, "slurm 12_3");
  for (const char* text : {"", "{}", "[1]", "{\"host\": 3}", "\xff"})
    EXPECT_FALSE(lock_holder_of(text).has_value()) << text;
}

TEST(OutputLock, KnowsWhoIsGone) {
  const LockHolder mine = this_process();
  EXPECT_FALSE(is_known_gone(mine, mine));
  LockHolder other = mine;
  other.process_start += 1;  // the number was used again
  EXPECT_TRUE(is_known_gone(other, mine));
  other.host = "elsewhere";
  EXPECT_FALSE(is_known_gone(other, mine));
  LockHolder queued_again = mine;
  queued_again.job = other.job = "slurm 7";
  EXPECT_TRUE(is_known_gone(other, queued_again));
}

TEST(OutputLock, KnowsWhoseLocksReachOtherHosts) {
  const auto reach = [](const std::string& type_source_options) {
    return locks_reach_other_hosts("36 35 0:46 / /data rw,noatime shared:1 - " +
                                   type_source_options);
  };
  EXPECT_TRUE(reach("ext4 /dev/sda1 rw"));
  EXPECT_TRUE(reach("nfs4 server:/x rw,vers=4.2,local_lock=none"));
  EXPECT_FALSE(reach("nfs server:/x rw,vers=3,nolock,local_lock=all"));
  EXPECT_TRUE(reach("lustre mds@tcp:/x rw,flock,lazystatfs"));
  EXPECT_FALSE(reach("lustre mds@tcp:/x rw,localflock"));
  EXPECT_FALSE(reach("lustre mds@tcp:/x rw,noflock"));
  EXPECT_FALSE(reach("fuse.sshfs host:/x rw"));
  EXPECT_FALSE(locks_reach_other_hosts(""));
}

}  // namespace
}  // namespace af
