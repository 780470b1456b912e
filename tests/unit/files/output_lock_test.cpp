// SPDX-License-Identifier: Apache-2.0
#include "files/output_lock.h"

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/host_name.h"
#include "files/output_file.h"
#include "files/partial_folder.h"
#include "support/test_paths.h"

namespace af {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Lt;
using testing::SizeIs;

/// What taking the lock says; empty when it is given.
std::string refusal(const std::filesystem::path& output) {
  try {
    const OutputLock lock(output);
    return {};
  } catch (const InputError& error) {
    return error.what();
  }
}

/// What taking the lock says where something other than a lock file is in its place.
std::string failure(const std::filesystem::path& output) {
  try {
    const OutputLock lock(output);
    return {};
  } catch (const FileError& error) {
    return error.what();
  }
}

/// A child process that does some work. Only the destructor reaps it.
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

/// The lock that a job of another host left, as its file says.
std::string left_lock(const std::string& host, const std::string& job = "") {
  return "process 12 on " + host + ", " + job + "since 2026-01-01\n";
}

TEST(OutputLock, IsHeldByOneAndNamesIt) {
  const test::ScratchFolder folder;
  {
    const OutputLock lock(folder / "a.h5");
    const std::string said = refusal(folder / "a.h5");
    EXPECT_THAT(said, HasSubstr("another job is writing it: process " + std::to_string(getpid())));
    EXPECT_THAT(said, HasSubstr(" on " + host_name() + ", "));
    EXPECT_THAT(said, HasSubstr((folder / "a.h5.lock").string()));
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
  const Child killed([&] { be_killed_with_lock(folder / "a.h5"); });  // a zombie from then on
  EXPECT_EQ(killed.ended(), SIGKILL);
  EXPECT_THAT(read_text_file(folder / "a.h5.lock"),
              HasSubstr("process " + std::to_string(killed.process()) + " on " + host_name()));
  EXPECT_EQ(refusal(folder / "a.h5"), "");
}

TEST(OutputLock, ThatNobodyWroteItsNameIntoIsTakenOver) {
  const test::ScratchFolder folder;
  std::ofstream(folder / "a.h5.lock").close();
  EXPECT_EQ(refusal(folder / "a.h5"), "");
}

TEST(OutputLock, ThatAnotherHostLeftIsRefusedUnlessLocksAreOff) {
  const test::ScratchFolder folder;
  std::ofstream(folder / "a.h5.lock") << left_lock("elsewhere");
  EXPECT_THAT(refusal(folder / "a.h5"),
              AllOf(HasSubstr("process 12 on elsewhere"), HasSubstr("give --no-lock")));
  const Child child([&] {
    write_without_locks();
    _exit(refusal(folder / "a.h5").empty() ? 0 : 1);
  });
  EXPECT_EQ(child.ended(), 0);
  EXPECT_EQ(read_text_file(folder / "a.h5.lock"), left_lock("elsewhere"));
}

TEST(OutputLock, ThatTheSameBatchJobLeftOnAnotherHostIsTakenOver) {
  const test::ScratchFolder folder;
  setenv("PBS_JOBID", "7", 1);
  std::ofstream(folder / "a.h5.lock") << left_lock("elsewhere", "job 7, ");
  EXPECT_EQ(refusal(folder / "a.h5"), "");
  std::ofstream(folder / "a.h5.lock") << left_lock("elsewhere", "job 77, ");
  EXPECT_NE(refusal(folder / "a.h5"), "");
  unsetenv("PBS_JOBID");
}

TEST(OutputLock, IsNoFileOfAnotherKindThatHasItsName) {
  const test::ScratchFolder folder;
  const std::string of_this_host = "\nresolved on " + host_name() + ", since 2026-01-01\n";
  for (const std::string& text : {"[[package]]" + of_this_host, of_this_host}) {
    std::ofstream(folder / "packages.lock") << text;
    EXPECT_THAT(failure(folder / "packages"), HasSubstr("is not the lock of an output"));
    EXPECT_EQ(read_text_file(folder / "packages.lock"), text);
  }
}

TEST(OutputLock, TextOfAHolderIsMadeHarmless) {
  const test::ScratchFolder folder;
  std::ofstream(folder / "a.h5.lock") << "process \x1b[2J" + std::string(3000, 'x');
  EXPECT_THAT(refusal(folder / "a.h5"), AllOf(HasSubstr("process ?[2Jx"), SizeIs(Lt(2000U))));
}

TEST(OutputLock, OfAFolderServesWhatStandsWithinAndItsUnfinishedWork) {
  const test::ScratchFolder folder;
  const OutputLock lock(folder / "results");
  for (const char* name : {"results/a.csv", "results/b/c.csv", "results.partial/a.csv"}) {
    const OutputLock within(folder / name);
    EXPECT_FALSE(std::filesystem::exists((folder / name).string() + ".lock")) << name;
  }
  EXPECT_NE(refusal(folder / "results"), "");
  std::filesystem::create_directory(folder / "results.old");
  const OutputLock beside(folder / "results.old" / "a.csv");
  EXPECT_TRUE(std::filesystem::exists(folder / "results.old" / "a.csv.lock"));
}

// Of two programs that begin at the same time, the second ends before it reads anything.
TEST(OutputLock, OfAnAnnouncedFileIsHeldUntilItIsWritten) {
  const test::ScratchFolder folder;
  announce_output(folder / "a.txt");
  announce_output(folder / "a.txt");  // the same program may say it twice
  EXPECT_THAT(refusal(folder / "a.txt"), HasSubstr("another job is writing it"));
  write_text_file(folder / "a.txt", "mine");
  EXPECT_EQ(refusal(folder / "a.txt"), "");
  EXPECT_FALSE(std::filesystem::exists(folder / "a.txt.lock"));
}

TEST(OutputLock, OfAFileIsHeldWhileItIsWritten) {
  const test::ScratchFolder folder;
  write_atomically(folder / "a.txt", [&](const std::filesystem::path& partial) {
    std::ofstream(partial) << "mine";
    EXPECT_THROW(write_text_file(folder / "a.txt", "another's"), InputError);
  });
  EXPECT_EQ(read_text_file(folder / "a.txt"), "mine");
}

TEST(OutputLock, OfAPartialFolderKeepsASecondOneOut) {
  const test::ScratchFolder folder;
  PartialFolder first(folder / "study", PartialFolder::Existing::Replace);
  std::ofstream(first.path() / "a") << "first";
  EXPECT_THROW(PartialFolder(folder / "study/", PartialFolder::Existing::Replace), InputError);
  first.commit();
  EXPECT_EQ(read_own_text_file(folder / "study" / "a"), "first");
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
  std::ofstream(folder / "a.h5.lock") << left_lock("elsewhere");
  chmod((folder / "a.h5.lock").c_str(), 0444);
  EXPECT_THAT(failure(folder / "a.h5"), HasSubstr("it is the lock of process 12 on elsewhere"));
}

TEST(OutputLock, InAFolderThatDoesNotExistIsAnError) {
  const test::ScratchFolder folder;
  EXPECT_THAT(failure(folder / "gone" / "a.h5"), HasSubstr("No such file"));
}

TEST(OutputLock, StaysWhenItIsAnotherJobsByNow) {
  const test::ScratchFolder folder;
  {
    const OutputLock lock(folder / "a.h5");
    std::filesystem::remove(folder / "a.h5.lock");
    std::ofstream(folder / "a.h5.lock").close();  // another file of that name
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "a.h5.lock"));
}

}  // namespace
}  // namespace af
