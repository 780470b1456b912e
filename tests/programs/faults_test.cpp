// SPDX-License-Identifier: Apache-2.0
// Makes happen what goes wrong on clusters. Each fault ends the job with one message that names
// rank, host, unit and cause, and the same command goes on afterwards.
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/output_file.h"
#include "programs/slow_jobs.h"
#include "programs/small_study.h"
#include "support/launched_job.h"
#include "support/run_program.h"
#include "support/test_paths.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;

constexpr std::chrono::seconds kEndsWithin{300};
constexpr int kRanks = 3;

class Faults : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    test::prepare_slow_jobs();
    folder_ = new test::ScratchFolder();
    const fs::path payload_file = *folder_ / "payload.txt";
    test::prepare_once(folder_->path(), [&] {
      test::write_small_study(folder_->path());
      const test::ProgramRun run = test::run_command(words(precompute(kRanks)));
      ASSERT_EQ(run.exit_code, 0) << run.output;
      write_text_file(payload_file, payload());
      fs::remove(field());
    });
    payload_ = read_text_file(payload_file);
  }
  static void TearDownTestSuite() { delete folder_; }
  void SetUp() override { fs::remove(field()); }

  static fs::path field() { return *folder_ / "A.af.h5"; }
  static fs::path study_file() { return *folder_ / "study.toml"; }
  static fs::path progress() { return field().string() + ".progress"; }

  static std::vector<std::string> precompute(int ranks,
                                             const std::vector<std::string>& options = {}) {
    return test::under_mpirun(ranks, test::slow_precompute(folder_->path(), field(), options));
  }
  /// The same by processes instead of ranks of MPI.
  static std::vector<std::string> by_processes(std::vector<std::string> options = {}) {
    options.insert(options.end(), {"--processes", std::to_string(kRanks)});
    return test::slow_precompute(folder_->path(), field(), options);
  }
  static std::string words(const std::vector<std::string>& command) {
    std::string line;
    for (const std::string& word : command) line += word + " ";
    return line;
  }
  static std::string payload() {
    const test::ProgramRun run =
        test::run_command(AF_PROGRAM_FOLDER "/af-inspect --json " + field().string());
    EXPECT_EQ(run.exit_code, 0) << run.output;
    return nlohmann::json::parse(run.output)[0]["facts"]["payload_sha256"];
  }

  /// Whether the field is the one that ranks of MPI have made.
  static bool is_right() { return payload() == payload_; }

  static fs::path output() { return *folder_ / "output.txt"; }
  static std::string said() { return read_text_file(output()); }

  /// Units cast or encoded so far, in bytes.
  static std::uint64_t unit_bytes() {
    std::uint64_t bytes = 0;
    std::error_code gone;
    for (const auto& entry : fs::directory_iterator(progress(), gone))
      if (entry.path().extension() == ".records") bytes += fs::file_size(entry.path(), gone);
    return bytes;
  }

  /// The next run ends with the right field.
  static void expect_going_on() {
    const test::ProgramRun run = test::run_command(words(precompute(2)));
    EXPECT_EQ(run.exit_code, 0) << run.output;
    EXPECT_EQ(payload(), payload_);
    EXPECT_FALSE(fs::exists(progress()));
    EXPECT_FALSE(fs::exists(field().string() + ".lock"));
  }

  /// `command` as on a full disk: no file of a rank may grow beyond `bytes`. Segments of shared
  /// memory are files, too, so messages go through the loopback.
  static std::vector<std::string> on_full_disk(std::vector<std::string> command,
                                               std::uint64_t bytes) {
    const auto insert_before = [&](const std::string& word, std::vector<std::string> words) {
      const auto found = std::find(command.begin(), command.end(), word);
      ASSERT_NE(found, command.end());
      command.insert(found, words.begin(), words.end());
    };
    insert_before(AF_PROGRAM_FOLDER "/af-precompute",
                  {"prlimit", "--fsize=" + std::to_string(bytes)});
    insert_before(AF_MPIEXEC, {"env", "OMPI_MCA_btl=self,tcp", "OMPI_MCA_btl_tcp_if_include=lo"});
    return command;
  }

  static std::size_t count_of(const std::string& part, const std::string& text) {
    std::size_t count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
      ++count;
    return count;
  }

 private:
  static inline test::ScratchFolder* folder_ = nullptr;
  static inline std::string payload_;
};

TEST_F(Faults, IsPrepared) {
  EXPECT_TRUE(fs::exists(study_file()));
}

TEST_F(Faults, TimeThatIsOverStopsTheJobByItself) {
  // The limit passes 1.1 s after the start of each rank. Casting alone takes longer.
  const test::ProgramRun run =
      test::run_command(words(precompute(kRanks, {"--max-hours", "1e-4"})));
  EXPECT_EQ(run.exit_code, 75) << run.output;
  EXPECT_THAT(run.output, AllOf(HasSubstr("stopped"), HasSubstr("(--max-hours 0.0001)")));
  expect_going_on();
}

TEST_F(Faults, ASecondJobIsRefusedAndToldOfTheFirst) {
  test::LaunchedJob first(precompute(2), output());
  ASSERT_TRUE(first.wait_until([] { return unit_bytes() > 0; }));
  // Holds the first job, which might otherwise end before the second looks.
  for (const pid_t rank : first.ranks()) kill(rank, SIGSTOP);
  const test::ProgramRun second = test::run_command(words(precompute(1)));
  for (const pid_t rank : first.ranks()) kill(rank, SIGCONT);
  EXPECT_EQ(second.exit_code, 3) << second.output;
  EXPECT_THAT(second.output,
              AllOf(HasSubstr("another job is writing it: process "), HasSubstr(", since 20")));
  EXPECT_EQ(first.wait(kEndsWithin), 0) << said();
  EXPECT_FALSE(fs::exists(field().string() + ".lock"));
}

TEST_F(Faults, AStoppedRankIsNamedAndTheJobEnded) {
  // The limit must be longer than a collective write, which may take some seconds on a busy
  // machine.
  test::LaunchedJob job(precompute(kRanks, {"--stall-minutes", "0.15"}), output());
  ASSERT_TRUE(job.wait_until([] { return unit_bytes() > 0; })) << said();
  ASSERT_FALSE(job.ranks().empty());
  kill(job.ranks().back(), SIGSTOP);
  EXPECT_EQ(job.wait(kEndsWithin), 75) << said();
  EXPECT_THAT(said(), ContainsRegex("rank [0-9] on .*: (no progress|is stopped: has not run) for"));
  EXPECT_EQ(count_of("(--stall-minutes): the job is ended", said()), 1u);
  expect_going_on();
}

TEST_F(Faults, ARankThatIsStoppedWhileOthersEndDoesNotKeepTheJob) {
  // Rank 1 stops itself. Rank 0 has nothing more to do, and waits for it in MPI_Finalize().
  test::LaunchedJob job({AF_MPIEXEC, "-n", "2", AF_STOPPED_RANK_PROGRAM, "--stall-minutes", "0.05"},
                        output());
  EXPECT_EQ(job.wait(kEndsWithin), 75) << said();
  EXPECT_THAT(said(), HasSubstr("(--stall-minutes): the job is ended"));
}

TEST_F(Faults, AFullDiskWhileCastingNamesTheUnit) {
  test::LaunchedJob job(on_full_disk(precompute(kRanks), 300'000), output());
  EXPECT_EQ(job.wait(kEndsWithin), 4) << said();
  EXPECT_THAT(said(),
              ContainsRegex("rank [0-9] on .*: casting unit .*records: cannot be written: File too "
                            "large"));
  expect_going_on();
}

TEST_F(Faults, AFullDiskWhileTheFieldIsWrittenEndsTheJobAtOnce) {
  // When one rank fails in a collective write, the others would wait for ever.
  for (const int ranks : {1, kRanks}) {
    constexpr std::uint64_t kMoreThanTheDeflatedCodebook = 400'000;
    test::LaunchedJob job(
        on_full_disk(precompute(ranks, {"--no-checkpoint"}), kMoreThanTheDeflatedCodebook),
        output());
    EXPECT_EQ(job.wait(kEndsWithin), 4) << said();
    // Where Open MPI's write does not report the failure, closing the file does.
    const std::string rank = ranks == 1 ? "af-precompute: " : "rank [0-9] on .*: ";
    EXPECT_THAT(said(),
                ContainsRegex(rank + "(writing round 1 of the indices: .*H5Dwrite"
                                     "|closing the file that all ranks wrote: .*H5Fclose) failed"));
    EXPECT_EQ(count_of("H5Dwrite failed", said()) + count_of("H5Fclose failed", said()), 1u)
        << said();
    EXPECT_FALSE(fs::exists(field()));
  }
  expect_going_on();
}

TEST_F(Faults, ProcessesMakeTheFieldThatRanksMake) {
  const test::ProgramRun run = test::run_command(words(by_processes()));
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_TRUE(is_right());
}

TEST_F(Faults, AKilledProcessIsNamedAndTheJobEnded) {
  test::LaunchedJob job(by_processes(), output());
  ASSERT_TRUE(job.wait_until([] { return unit_bytes() > 0; })) << said();
  ASSERT_EQ(job.ranks().size(), std::size_t{kRanks} - 1);
  kill(job.ranks().back(), SIGKILL);
  EXPECT_EQ(job.wait(kEndsWithin), 75) << said();
  EXPECT_THAT(
      said(),
      ContainsRegex("rank [0-9] \\(process [0-9]+\\) was ended by signal 9 \\(Killed\\): the "
                    "job is ended; run the same command again"));
  expect_going_on();
}

TEST_F(Faults, AKilledProcessIsNoticedWhereEndsOfProcessesWereIgnored) {
  std::vector<std::string> command = {"env", "--ignore-signal=CHLD"};
  for (const std::string& word : by_processes()) command.push_back(word);
  test::LaunchedJob job(command, output());
  ASSERT_TRUE(job.wait_until([] { return unit_bytes() > 0; })) << said();
  ASSERT_FALSE(job.ranks().empty());
  kill(job.ranks().back(), SIGKILL);
  EXPECT_EQ(job.wait(kEndsWithin), 75) << said();
  EXPECT_THAT(said(), HasSubstr("was ended by signal 9 (Killed)"));
  expect_going_on();
}

TEST_F(Faults, ProcessesEndWithTheFirst) {
  test::LaunchedJob job(by_processes(), output());
  ASSERT_TRUE(job.wait_until([] { return unit_bytes() > 0; })) << said();
  kill(job.launcher(), SIGKILL);
  EXPECT_EQ(job.wait(kEndsWithin), 128 + SIGKILL) << said();
  expect_going_on();
}

TEST_F(Faults, AStoppedFirstProcessIsNamedAndTheJobEnded) {
  test::LaunchedJob job(by_processes({"--stall-minutes", "0.15"}), output());
  ASSERT_TRUE(job.wait_until([] { return unit_bytes() > 0; })) << said();
  kill(job.launcher(), SIGSTOP);
  EXPECT_EQ(job.wait(kEndsWithin), 75) << said();
  EXPECT_THAT(said(), ContainsRegex("rank 0 on .*: (no progress|is stopped: has not run) for"));
  EXPECT_EQ(count_of("(--stall-minutes): the job is ended", said()), 1u);
  expect_going_on();
}

TEST_F(Faults, ASignalToTheFirstProcessStopsAll) {
  test::LaunchedJob job(by_processes(), output());
  ASSERT_TRUE(job.wait_until([] { return unit_bytes() > 0; })) << said();
  kill(job.launcher(), SIGTERM);
  EXPECT_EQ(job.wait(kEndsWithin), 75) << said();
  EXPECT_THAT(said(), AllOf(HasSubstr("stopped"), HasSubstr("(SIGTERM)")));
  expect_going_on();
}

TEST_F(Faults, AFullDiskEndsAllProcesses) {
  constexpr std::uint64_t kLessThanUnits = 300'000;
  std::vector<std::string> command = {"prlimit", "--fsize=" + std::to_string(kLessThanUnits)};
  for (const std::string& word : by_processes()) command.push_back(word);
  test::LaunchedJob job(command, output());
  EXPECT_EQ(job.wait(kEndsWithin), 4) << said();
  EXPECT_THAT(said(),
              ContainsRegex("rank [0-9] on .*: casting unit .*records: cannot be written: File too "
                            "large"));
  expect_going_on();
}

TEST_F(Faults, AFullDiskWhileTheFirstProcessWritesTheFieldEndsAll) {
  constexpr std::uint64_t kMoreThanTheDeflatedCodebook = 400'000;
  std::vector<std::string> command = {"prlimit",
                                      "--fsize=" + std::to_string(kMoreThanTheDeflatedCodebook)};
  for (const std::string& word : by_processes({"--no-checkpoint"})) command.push_back(word);
  test::LaunchedJob job(command, output());
  EXPECT_EQ(job.wait(kEndsWithin), 4) << said();
  EXPECT_THAT(said(),
              ContainsRegex("rank 0 on .*: writing round 1 of the indices: .*(H5Dwrite|H5Dclose) "
                            "failed"));
  EXPECT_FALSE(fs::exists(field()));
  expect_going_on();
}

TEST_F(Faults, RanksOfALauncherAreNotMultiplied) {
  const test::ProgramRun run = test::run_command(words(precompute(2, {"--processes", "2"})));
  EXPECT_EQ(run.exit_code, 2) << run.output;
  EXPECT_THAT(run.output, HasSubstr("--processes"));
}

TEST_F(Faults, AProgressFolderDeletedMeanwhileIsSaidOrNotNeeded) {
  test::LaunchedJob job(precompute(kRanks), output());
  ASSERT_TRUE(job.wait_until([] { return unit_bytes() > 0; }));
  // The job may add a file while the folder is emptied.
  std::error_code error;
  do fs::remove_all(progress(), error);
  while (fs::exists(progress()));
  // Casting goes on, because its shards are open. The journal of the training cannot be created.
  EXPECT_EQ(job.wait(kEndsWithin), 4) << said();
  EXPECT_THAT(said(), HasSubstr(progress().string()));
  expect_going_on();
}

}  // namespace
}  // namespace af
