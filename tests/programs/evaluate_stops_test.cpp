// SPDX-License-Identifier: Apache-2.0
// When af-evaluate is cut short, it goes on to the same rows, on any rank count.
#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <ostream>
#include <string>
#include <sys/resource.h>
#include <thread>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/csv_table.h"
#include "programs/evaluated_study.h"
#include "support/kept_records.h"
#include "support/launched_job.h"
#include "support/run_program.h"

namespace af {
namespace {

using testing::HasSubstr;

/// How a run is cut short while its ranks stand still.
struct Cut {
  const char* name;
  std::function<void(test::LaunchedJob& job, const std::vector<pid_t>& ranks)> cut;
  bool is_stop;  ///< exit code 75; otherwise any but 0
};

void PrintTo(const Cut& cut, std::ostream* out) {
  *out << cut.name;
}

void send(const std::vector<pid_t>& processes, int signal) {
  for (const pid_t process : processes) kill(process, signal);
}

const Cut kCuts[] = {{"usr1", [](auto& job, const auto&) { kill(job.launcher(), SIGUSR1); }, true},
                     {"term",
                      [](auto& job, const auto& ranks) {
                        kill(job.launcher(), SIGTERM);
                        // Open MPI wakes the ranks a second before it passes the signal on.
                        while (!job.has_ended()) {
                          send(ranks, SIGSTOP);
                          std::this_thread::sleep_for(std::chrono::milliseconds(20));
                        }
                      },
                      false},
                     {"rank", [](auto&, const auto& ranks) { kill(ranks.back(), SIGKILL); }, false},
                     {"all",
                      [](auto& job, const auto& ranks) {
                        kill(job.launcher(), SIGKILL);
                        send(ranks, SIGKILL);
                      },
                      false}};

std::uint64_t record_bytes(const std::filesystem::path& progress) {
  std::uint64_t bytes = 0;
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator(progress, gone))
    if (entry.path().extension() == ".records") bytes += entry.file_size(gone);
  return bytes;
}

/// Waits until some registrations are kept, and cuts the run short. It holds the ranks first, so
/// that they cannot finish before the cut. Returns the exit code once no process of the run is
/// left.
int exit_code_when_cut(const Cut& cut,
                       const std::vector<std::string>& command,
                       const std::string& progress,
                       const std::string& said) {
  test::LaunchedJob job(command, said);
  EXPECT_TRUE(job.wait_until([&] { return record_bytes(progress) > 4000; }));
  const std::vector<pid_t> ranks = job.ranks();
  send(ranks, SIGSTOP);
  cut.cut(job, ranks);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  send(ranks, SIGCONT);
  return job.wait(std::chrono::minutes(5));
}

/// Registrations that last some seconds, and the rows of an undisturbed run in whole/.
class EvaluateStops : public test::EvaluatedStudy {
 protected:
  static void SetUpTestSuite() {
    set_up([] { ASSERT_EQ(evaluate(arguments("whole"), 2).exit_code, 0); });
  }
  static std::string arguments(const std::string& folder) {
    return "registration --study " + path("study.toml") + fields() +
           "--preset paper --starts-per-interval 10 --no-pictures -o " + path(folder);
  }
  static std::vector<std::string> on_two_ranks(const std::string& folder) {
    return on_ranks(2, arguments(folder) + " --stall-minutes 0.1");
  }
  static bool has_rows(const std::string& folder) {
    return record_bytes(path(folder + ".progress")) > 0;
  }
  static void expect_going_on(const std::string& folder) {
    const test::ProgramRun run = evaluate(arguments(folder), 2);
    EXPECT_EQ(run.exit_code, 0) << run.output;
    EXPECT_THAT(run.output, HasSubstr("goes on after"));
    EXPECT_EQ(CsvTable::read(path(folder + "/registrations.csv")).row_count(), 80U);
  }
  static constexpr std::chrono::seconds kEndsWithin{300};
};

TEST_F(EvaluateStops, IsPrepared) {
  EXPECT_TRUE(std::filesystem::exists(path("whole/registrations.csv")));
}

class StoppedRegistrations : public EvaluateStops,
                             public testing::WithParamInterface<std::tuple<int, Cut>> {};

TEST_P(StoppedRegistrations, GoOnOnAnotherRankCount) {
  const auto& [ranks, cut] = GetParam();
  const std::string out = path("cut");
  const std::vector<std::string> command = on_ranks(ranks, arguments("cut"));
  const int exit_code = exit_code_when_cut(cut, command, out + ".progress", path("said.txt"));
  EXPECT_EQ(exit_code == 75, cut.is_stop) << exit_code << text("said.txt");
  EXPECT_NE(exit_code, 0) << text("said.txt");
  EXPECT_FALSE(std::filesystem::exists(out + "/summary.json"));
  if (ranks == 1) expect_refused(evaluate(arguments("cut") + " --seed 2", 1), 3, "begun with 1");
  const std::uint64_t kept = test::kept_records(out + ".progress");
  EXPECT_GT(kept, 0U);
  const test::ProgramRun resumed = evaluate(arguments("cut"), ranks % 3 + 1);
  ASSERT_EQ(resumed.exit_code, 0) << resumed.output;
  EXPECT_THAT(resumed.output, HasSubstr("goes on after " + std::to_string(kept) + " of 80"));
  EXPECT_EQ(rows_without_seconds("cut"), rows_without_seconds("whole"));
  EXPECT_FALSE(std::filesystem::exists(out + ".progress"));
}
INSTANTIATE_TEST_SUITE_P(Cuts,
                         StoppedRegistrations,
                         testing::Combine(testing::Values(1, 2, 4), testing::ValuesIn(kCuts)));

TEST_F(EvaluateStops, AStoppedRankIsNamedWithItsStartAndTheJobEnded) {
  test::LaunchedJob job(on_two_ranks("stalled"), path("said.txt"));
  ASSERT_TRUE(job.wait_until([] { return has_rows("stalled"); }));
  ASSERT_FALSE(job.ranks().empty());
  kill(job.ranks().back(), SIGSTOP);
  EXPECT_EQ(job.wait(kEndsWithin), 75) << text("said.txt");
  // The stopped rank was at a start, or waited for the other.
  EXPECT_THAT(text("said.txt"),
              testing::ContainsRegex(
                  "rank [01] on .*(registrations: item [0-9]+ .[0-9]+ of 80.: no progress for|"
                  "is stopped: has not run for)"));
  expect_going_on("stalled");
}

TEST_F(EvaluateStops, AFullDiskNamesTheFileAndWhatIsFinishedIsKept) {
  test::LaunchedJob job(on_two_ranks("full"), path("said.txt"));
  ASSERT_TRUE(job.wait_until([] { return has_rows("full"); }));
  const rlimit limit{6000, 6000};  // some twenty rows
  for (const pid_t process : job.ranks())
    EXPECT_EQ(prlimit(process, RLIMIT_FSIZE, &limit, nullptr), 0);
  EXPECT_EQ(job.wait(kEndsWithin), 4) << text("said.txt");
  EXPECT_THAT(text("said.txt"), HasSubstr(".records: cannot be written: File too large"));
  expect_going_on("full");
}

TEST_F(EvaluateStops, EveryStageThatTakesLongGoesOnAfterStops) {
  const std::string field = "image-quality --field " + path("LAT.af.h5") + " --ct " +
                            path("ct.nii.gz") + " --pose-count 40 --split-loss-poses 2 -o ";
  const std::string curves = "similarity-curves --study " + path("study.toml") + fields() +
                             "--half-width-mm 2 --half-width-deg 2 -o ";
  struct Run {
    std::string arguments;
    std::string name;
    std::vector<std::string> tables;  // one per stage
  };
  for (const auto& [arguments, name, tables] :
       {Run{field, "field-", {"image-quality.csv", "loss-split.csv"}},
        Run{curves, "curves-", {"similarity-curves.csv"}}}) {
    SCOPED_TRACE(name);
    ASSERT_EQ(evaluate(arguments + path(name + "whole")).exit_code, 0);
    const std::string stopped = path(name + "stopped");
    expect_refused(evaluate(arguments + stopped + test::kStopAtOnce, 2), 75, "saved: run the same");
    EXPECT_FALSE(std::filesystem::exists(stopped + "/summary.json"));
    expect_refused(evaluate(arguments + stopped + " --step-mm 0.7"), 3, "begun with");
    const test::ProgramRun last =
        test::run_until_done(AF_PROGRAM_FOLDER "/af-evaluate " + arguments + stopped);
    ASSERT_EQ(last.exit_code, 0) << last.output;
    for (const std::string& table : tables)
      EXPECT_EQ(text(name + "stopped/" + table), text(name + "whole/" + table)) << table;
    EXPECT_FALSE(std::filesystem::exists(stopped + ".progress"));
  }
}

}  // namespace
}  // namespace af
