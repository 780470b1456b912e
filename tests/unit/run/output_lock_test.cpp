// SPDX-License-Identifier: Apache-2.0
#include "run/output_lock.h"

#include <csignal>
#include <cstdlib>
#include <functional>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "files/output_file.h"
#include "run/process_state.h"
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

/// What taking the lock says where something else than a lock file is in its place.
std::string failure(const std::filesystem::path& output) {
  try {
    const OutputLock lock(output);
    return {};
  } catch (const FileError& error) {
    return error.what();
  }
}

/// A process of its own that does something and does not come back from it.
class Child {
 public:
  explicit Child(const std::function<void()>& work) : process_(fork()) {
    if (process_ != 0) return;
    work();
    _exit(0);
  }
  ~Child() {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  [[nodiscard]] pid_t process() const { return process_; }
  /// Waits for the end, and leaves a zombie.
  [[nodiscard]] int ended() const {
    siginfo_t info{};
    waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOWAIT);
    return info.si_status;
  }

 private:
  pid_t process_;
};

/// Takes the lock and is killed with it, as a job is.
void be_killed_with_lock(const std::filesystem::path& output) {
  const OutputLock lock(output);
  kill(getpid(), SIGKILL);
}

LockHolder holder_of(const std::filesystem::path& output) {
  return lock_holder_of(read_text_file(output.string() + ".lock")).value();
}

LockHolder killed_with_lock(const std::filesystem::path& output) {
  EXPECT_EQ(Child([&] { be_killed_with_lock(output); }).ended(), SIGKILL);
  return holder_of(output);
}

TEST(OutputLock, IsHeldByOneAndNamesIt) {
  const test::ScratchFolder folder;
  {
    const OutputLock lock(folder / "a.h5");
    const std::string said = refusal(folder / "a.h5");
    EXPECT_THAT(said, HasSubstr("another job is writing it: process " + std::to_string(getpid())));
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

TEST(OutputLock, OfAZombieIsKnownToBeGone) {
  const test::ScratchFolder folder;
  const Child killed([&] { be_killed_with_lock(folder / "a.h5"); });
  EXPECT_EQ(killed.ended(), SIGKILL);
  const LockHolder holder = holder_of(folder / "a.h5");
  EXPECT_EQ(holder.process, killed.process());
  EXPECT_TRUE(is_known_gone(holder, this_process()));
  EXPECT_EQ(refusal(folder / "a.h5"), "");
}

TEST(OutputLock, OfAProcessWhoseFirstThreadHasEndedIsNotGone) {
  const Child child([] {
    std::thread([] { pause(); }).detach();
    syscall(SYS_exit, 0);  // of this thread alone
  });
  // Until the process's first thread is a zombie; the process is none.
  const std::string stat_file = "/proc/" + std::to_string(child.process()) + "/stat";
  while (read_text_file(stat_file).find(") Z ") == std::string::npos) std::this_thread::yield();
  LockHolder holder = this_process();
  holder.process = child.process();
  holder.process_start = process_start(child.process());
  EXPECT_FALSE(is_known_gone(holder, this_process()));
}

TEST(OutputLock, IsTakenOverInAChrootWhoseRootIsNoMountPoint) {
  const test::ScratchFolder folder;
  write_text_file(folder / "a.h5.lock", "");
  constexpr int kNotAllowed = 77;
  const Child child([&] {
    // No /proc either.
    if (chroot(folder.path().c_str()) != 0) _exit(kNotAllowed);
    _exit(refusal("/a.h5").empty() ? 0 : 1);
  });
  const int code = child.ended();
  if (code == kNotAllowed) GTEST_SKIP() << "only root may change the root folder";
  EXPECT_EQ(code, 0);
}

TEST(OutputLock, IsNoLinkFolderOrPipeOfThatName) {
  const test::ScratchFolder folder;
  std::filesystem::create_directory(folder / "a.h5.lock");
  std::filesystem::create_symlink("nowhere", folder / "b.h5.lock");
  ASSERT_EQ(mkfifo((folder / "c.h5.lock").c_str(), 0600), 0);
  for (const char* name : {"a.h5", "b.h5", "c.h5"}) {
    EXPECT_THAT(failure(folder / name), HasSubstr("is not a regular file")) << name;
    EXPECT_THAT(failure(folder / name), HasSubstr("remove it")) << name;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "nowhere"));
}

TEST(OutputLock, ThatMayOnlyBeReadSaysWhoseItIs) {
  if (geteuid() == 0) GTEST_SKIP() << "root may write every file";
  const test::ScratchFolder folder;
  write_text_file(folder / "a.h5.lock", to_json(this_process()));
  chmod((folder / "a.h5.lock").c_str(), 0444);
  EXPECT_THAT(failure(folder / "a.h5"),
              HasSubstr("it is the lock of process " + std::to_string(getpid())));
}

TEST(OutputLock, InAFolderThatDoesNotExistIsAnError) {
  const test::ScratchFolder folder;
  EXPECT_THAT(failure(folder / "gone" / "a.h5"), HasSubstr("No such file"));
}

TEST(OutputLock, StaysWhenItIsAnotherJobsByNow) {
  const test::ScratchFolder folder;
  {
    const OutputLock lock(folder / "a.h5");
    write_text_file(folder / "a.h5.lock", "");  // another file of that name
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "a.h5.lock"));
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

TEST(OutputLock, HostileTextOfAHolderIsRefusedOrMadeHarmless) {
  const auto with_process = [](const std::string& number) {
    return R"({"host": "a", "process": )" + number +
           R"(, "process_start": 1, "job": "", "since": "", "command": "\u001b[2J)" +
           std::string(5000, 'x') + "\"}";
  };
  for (const char* number : {"-1", "1e300", "NaN", "2147483648", "1.5", "\"1\"", "true"})
    EXPECT_FALSE(lock_holder_of(with_process(number)).has_value()) << number;
  const auto holder = lock_holder_of(with_process("2147483647"));
  ASSERT_TRUE(holder.has_value());
  EXPECT_EQ(holder->command.substr(0, 5), "?[2Jx");
  EXPECT_LE(holder->command.size(), 1000u);
  EXPECT_FALSE(lock_holder_of(std::string(64 << 10, '[')).has_value());
}

TEST(OutputLock, KnowsWhoIsGone) {
  const LockHolder mine = this_process();
  ASSERT_NE(mine.process_space, "");
  EXPECT_FALSE(is_known_gone(mine, mine));
  LockHolder other = mine;
  other.process_start += 1;  // the number was used again
  EXPECT_TRUE(is_known_gone(other, mine));
  LockHolder in_container = other;  // of the same name
  in_container.process_space += "another";
  EXPECT_FALSE(is_known_gone(in_container, mine));
  LockHolder without_proc = mine;
  without_proc.process_space = other.process_space = "";
  EXPECT_FALSE(is_known_gone(other, without_proc));
  other.host = "elsewhere";
  EXPECT_FALSE(is_known_gone(other, mine));
}

TEST(OutputLock, OfABatchJobIsGoneWhenThatRunsAgainButNotOfAnotherStepOfIt) {
  LockHolder mine = this_process();
  LockHolder other = mine;
  mine.job = other.job = "slurm 7";
  EXPECT_FALSE(is_known_gone(other, mine));  // runs beside this one, on this host
  other.host = "elsewhere";
  EXPECT_TRUE(is_known_gone(other, mine));
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
  for (const std::uint32_t magic : {0xEF53u, 0x58465342u, 0x9123683Eu, 0x01021994u, 0x794C7630u})
    EXPECT_TRUE(locks_reach_other_hosts(magic)) << std::hex << magic;
  constexpr std::uint32_t kNfs = 0x6969, kLustre = 0x0BD00BD0, kFuse = 0x65735546, k9p = 0x01021997;
  for (const std::uint32_t magic : {kNfs, kLustre, kFuse, k9p, 0u})
    EXPECT_FALSE(locks_reach_other_hosts(magic)) << std::hex << magic;
}

}  // namespace
}  // namespace af
