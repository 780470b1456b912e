// SPDX-License-Identifier: Apache-2.0
// Cuts jobs short at random moments within every stage, and continues them on other rank counts.
// Nothing may be lost or done twice, and the bytes are the same. Files damaged in between are
// mended or refused. By default a few kills are drawn: AF_KILLS=100 kills as many times,
// AF_KILL_SEED draws others.
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "files/csv_table.h"
#include "files/output_file.h"
#include "programs/progress_damage.h"
#include "programs/slow_jobs.h"
#include "programs/small_study.h"
#include "support/kept_records.h"
#include "support/launched_job.h"
#include "support/run_program.h"
#include "support/test_paths.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

enum class Stage { Cast, Train, Encode, Evaluate };
enum class Cut { Usr1, Term, KillRank, KillAll };
constexpr std::array kCastTrainEncode = {Stage::Cast, Stage::Train, Stage::Encode};
constexpr std::array kCuts = {Cut::Usr1, Cut::Term, Cut::KillRank, Cut::KillAll};
constexpr std::array kRankCounts = {1, 2, 4};
constexpr std::chrono::seconds kEndsWithin{300};

const char* name_of(Stage stage) {
  constexpr std::array names = {"cast", "train", "encode", "evaluate"};
  return names[static_cast<std::size_t>(stage)];
}

const char* name_of(Cut cut) {
  constexpr std::array names = {"SIGUSR1", "SIGTERM", "SIGKILL of one rank", "SIGKILL of all"};
  return names[static_cast<std::size_t>(cut)];
}

void PrintTo(Stage stage, std::ostream* out) {
  *out << name_of(stage);
}

void PrintTo(Cut cut, std::ostream* out) {
  *out << name_of(cut);
}

std::uint64_t setting(const char* variable, std::uint64_t otherwise) {
  const char* const text = std::getenv(variable);
  return text == nullptr ? otherwise : std::stoull(text);
}

/// Bytes of finished work below a progress folder; 0 when it is not there.
struct ProgressBytes {
  std::uint64_t units = 0;     ///< tiles, then indices
  std::uint64_t training = 0;  ///< iterations; rows of registrations
};

std::uint64_t bytes_of_journals(const fs::path& folder, bool are_of_units) {
  std::uint64_t bytes = 0;
  std::error_code gone;
  for (const auto& entry : fs::directory_iterator(folder, gone))
    if (test::is_of_journal(entry.path(), "") &&
        test::is_of_journal(entry.path(), "units.") == are_of_units)
      if (const std::uintmax_t size = fs::file_size(entry.path(), gone); !gone) bytes += size;
  return bytes;
}

/// Units are read first. If training is still empty after them, they are cast ones.
ProgressBytes progress_bytes(const fs::path& folder) {
  ProgressBytes bytes;
  bytes.units = bytes_of_journals(folder, true);
  bytes.training = bytes_of_journals(folder, false);
  return bytes;
}

/// Records that are whole in the progress of af-precompute, counted from the bytes.
struct KeptWork {
  std::set<std::int64_t> cast;
  std::set<std::int64_t> encoded;
  std::uint64_t iterations = 0;
};

/// Unit n has two keys: 2 n for its tiles, 2 n + 1 for its indices.
KeptWork kept_work(const fs::path& folder) {
  KeptWork kept;
  for (const std::int64_t key : test::kept_keys(folder, "units."))
    (key % 2 == 0 ? kept.cast : kept.encoded).insert(key / 2);
  kept.iterations = test::kept_records(folder, "training.");
  return kept;
}

/// Bytes of progress at which the stages of an undisturbed run end.
struct StageBytes {
  std::uint64_t all_cast = 0;
  std::uint64_t all_trained = 0;
  std::uint64_t all_encoded = 0;
};

/// One run to be cut: what, where, when, how.
struct Plan {
  Stage stage = Stage::Cast;
  Cut cut = Cut::Usr1;
  int ranks = 1;
  int other_ranks = 2;
  std::optional<test::Damage> damage = std::nullopt;  ///< before it goes on
};

class KillMatrix : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    std::cout << "AF_KILL_SEED=" << setting("AF_KILL_SEED", 1) << '\n';
    test::prepare_slow_jobs();
    folder_ = new test::ScratchFolder();
    test::prepare_once(folder_->path(), run_undisturbed);
    undisturbed_ = json::parse(read_text_file(path("undisturbed.json")));
    rows_ = rows_without_seconds(path("whole"));
  }
  static void TearDownTestSuite() { delete folder_; }

  static fs::path path(const std::string& name) { return *folder_ / name; }

  static std::vector<std::string> precompute(int ranks, const fs::path& field) {
    return test::under_mpirun(ranks, test::slow_precompute(folder_->path(), field));
  }
  static std::vector<std::string> registration(int ranks, const fs::path& folder) {
    return test::under_mpirun(ranks,
                              {AF_PROGRAM_FOLDER "/af-evaluate",
                               "registration",
                               "--study",
                               path("study.toml"),
                               "--field",
                               "AP=" + path("AP.af.h5").string(),
                               "--field",
                               "LAT=" + path("LAT.af.h5").string(),
                               "--preset",
                               "paper",
                               "--starts-per-interval",
                               "25",
                               "--no-pictures",
                               "-o",
                               folder});
  }

  /// What af-inspect says of a field whose checksums it has verified.
  static json inspected(const fs::path& field) {
    const test::ProgramRun run =
        test::run_command(AF_PROGRAM_FOLDER "/af-inspect --json " + field.string());
    EXPECT_EQ(run.exit_code, 0) << run.output;
    return json::parse(run.output)[0]["facts"];
  }

  /// Measures where the stages lie for each rank count, the payload, and the rows of registrations.
  static void run_undisturbed() {
    test::write_small_study(folder_->path());
    make_fields();
    undisturbed_["registration_bytes"] = measure_registration();
    for (const int ranks : kRankCounts) measure(ranks);
    write_text_file(path("undisturbed.json"), undisturbed_.dump());
  }

  static void measure(int ranks) {
    const fs::path field = path("whole.af.h5");
    const fs::path progress = field.string() + ".progress";
    StageBytes bytes;
    test::LaunchedJob job(precompute(ranks, field), path("output.txt"));
    job.wait_until([&] {
      const ProgressBytes now = progress_bytes(progress);
      bytes.all_trained = std::max(bytes.all_trained, now.training);
      // Asks for the maximum, because training is 0 again while the folder is being removed.
      if (bytes.all_trained == 0) bytes.all_cast = std::max(bytes.all_cast, now.units);
      bytes.all_encoded = std::max(bytes.all_encoded, now.units);
      return false;
    });
    EXPECT_EQ(job.wait(kEndsWithin), 0) << read_text_file(path("output.txt"));
    const json payload = inspected(field)["payload_sha256"];
    EXPECT_EQ(payload, undisturbed_.value("payload", payload));
    undisturbed_["payload"] = payload;
    undisturbed_["stages"][std::to_string(ranks)] = {
        bytes.all_cast, bytes.all_trained, bytes.all_encoded};
    fs::remove(field);
  }

  static StageBytes bytes_on(int ranks) {
    const json& bytes = undisturbed_["stages"][std::to_string(ranks)];
    return {bytes[0], bytes[1], bytes[2]};
  }

  double fraction() { return std::uniform_real_distribution<>(0.0, 1.0)(random_); }

  /// Waits for a moment of a stage that is drawn uniformly over its finished work, and then a
  /// little longer, so that moments within a unit are hit, too.
  bool reach(const Plan& plan, test::LaunchedJob& job, const fs::path& progress) {
    const StageBytes stages = bytes_on(plan.ranks);
    const std::uint64_t registration_bytes = undisturbed_["registration_bytes"];
    const double drawn = fraction();
    const auto part = [&](std::uint64_t begin, std::uint64_t end) {
      return begin + static_cast<std::uint64_t>(drawn * static_cast<double>(end - begin));
    };
    const bool is_reached = job.wait_until([&] {
      const ProgressBytes now = progress_bytes(progress);
      switch (plan.stage) {
        case Stage::Cast:
          return now.units > part(0, stages.all_cast);
        case Stage::Train:
          return now.units >= stages.all_cast && now.training >= part(0, stages.all_trained);
        case Stage::Encode:
          return now.units > part(stages.all_cast, stages.all_encoded);
        case Stage::Evaluate:
          return now.training > part(0, registration_bytes);
      }
      return false;
    });
    // At most about the time that a unit takes; encoding one takes no longer than a poll.
    constexpr std::array kLongestUnitMs = {10.0, 100.0, 0.0, 20.0};
    const double unit_ms = kLongestUnitMs[static_cast<std::size_t>(plan.stage)];
    std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(fraction() * unit_ms));
    return is_reached;
  }

  void cut_short(const Plan& plan, test::LaunchedJob& job) {
    std::vector<pid_t> ranks = job.ranks();
    std::shuffle(ranks.begin(), ranks.end(), random_);
    if (plan.cut == Cut::Usr1) kill(job.launcher(), SIGUSR1);
    if (plan.cut == Cut::Term) {
      // Open MPI wakes the ranks a second before it passes the signal on. Some stages are shorter
      // than that, so this keeps stopping the ranks.
      kill(job.launcher(), SIGTERM);
      job.wait_until([&] {
        for (const pid_t rank : job.ranks()) kill(rank, SIGSTOP);
        return false;
      });
    }
    if (plan.cut == Cut::KillAll) kill(job.launcher(), SIGKILL);
    if (plan.cut == Cut::KillRank && !ranks.empty()) kill(ranks.front(), SIGKILL);
    if (plan.cut == Cut::KillAll)
      for (const pid_t rank : ranks) kill(rank, SIGKILL);
  }

  /// Cuts a run of af-precompute; false when it was over before the signal came.
  bool cut_field(const Plan& plan, const fs::path& field) {
    const fs::path progress = field.string() + ".progress";
    test::LaunchedJob job(precompute(plan.ranks, field), path("output.txt"));
    const bool is_reached = reach(plan, job, progress);
    if (is_reached) cut_short(plan, job);
    const int exit_code = job.wait(kEndsWithin);
    if (!is_reached || fs::exists(field)) return false;
    const std::string said = read_text_file(path("output.txt"));
    EXPECT_EQ(exit_code == 75, plan.cut == Cut::Usr1) << exit_code << said;
    EXPECT_NE(exit_code, 0) << said;
    if (plan.cut == Cut::Usr1) {
      EXPECT_NE(said.find("run the same command again"), std::string::npos) << said;
    }
    return true;
  }

  /// Continues to the end. The payload must be the same, and no kept work may be done again.
  void expect_whole(const Plan& plan, const fs::path& field) {
    const fs::path progress = field.string() + ".progress";
    const KeptWork kept = kept_work(progress);
    test::LaunchedJob job(precompute(plan.other_ranks, field), path("output.txt"));
    ASSERT_EQ(job.wait(kEndsWithin), 0) << read_text_file(path("output.txt"));
    const json facts = inspected(field);
    EXPECT_EQ(facts["payload_sha256"], undisturbed_["payload"]);
    const json details = facts["provenance"]["details"];
    EXPECT_EQ(details["units_resumed"], kept.cast.size());
    EXPECT_EQ(details["training_iterations_resumed"], kept.iterations);
    EXPECT_EQ(details["units_encoded_before"], kept.encoded.size());
    EXPECT_FALSE(fs::exists(progress));
    units_kept_ += kept.cast.size();
    iterations_kept_ += kept.iterations;
    encoded_kept_ += kept.encoded.size();
  }

  /// Runs a command to its end. True when it did the work, false when it refused and said what to
  /// do.
  static bool is_done(const std::vector<std::string>& command) {
    test::LaunchedJob job(command, path("output.txt"));
    const int exit_code = job.wait(kEndsWithin);
    const std::string said = read_text_file(path("output.txt"));
    if (exit_code == 0) return true;
    EXPECT_TRUE(exit_code == 3 || exit_code == 4) << exit_code << said;
    EXPECT_NE(said.find("--restart"), std::string::npos) << said;
    return false;
  }

  /// Continues with damaged progress. It must end with the same bytes, or be refused and do so with
  /// --restart.
  void expect_same_or_refused(const Plan& plan, const fs::path& output) {
    const bool is_evaluation = plan.stage == Stage::Evaluate;
    std::vector<std::string> command = is_evaluation ? registration(plan.other_ranks, output)
                                                     : precompute(plan.other_ranks, output);
    if (!is_done(command)) {
      ++refusals_;
      command.emplace_back("--restart");
      ASSERT_TRUE(is_done(command)) << read_text_file(path("output.txt"));
    }
    if (is_evaluation) {
      EXPECT_EQ(rows_without_seconds(output), rows_);
    } else {
      EXPECT_EQ(inspected(output)["payload_sha256"], undisturbed_["payload"]);
    }
    EXPECT_FALSE(fs::exists(output.string() + ".progress"));
  }

  static void make_fields() {
    for (const std::string camera : {"AP", "LAT"}) {
      const test::ProgramRun run = test::run_command(
          std::string(AF_PROGRAM_FOLDER
                      "/af-precompute --max-rotation-deg 15 "
                      "--max-translation-mm 12 --uv-nodes 20 --st-nodes 64 --codewords 512 ") +
          "--camera " + camera + " --study " + path("study.toml").string() + " -o " +
          path(camera + ".af.h5").string());
      ASSERT_EQ(run.exit_code, 0) << run.output;
    }
  }

  static std::string rows_without_seconds(const fs::path& folder) {
    const CsvTable table = CsvTable::read(folder / "registrations.csv");
    std::string result;
    for (std::size_t i = 0; i < table.row_count(); ++i)
      for (const std::string& column : table.columns())
        if (column != "seconds") result += table.text(i, column) + ",";
    return result;
  }

  /// The bytes of all rows of an undisturbed run, which leaves its results in whole/.
  static std::uint64_t measure_registration() {
    std::uint64_t bytes = 0;
    test::LaunchedJob job(registration(2, path("whole")), path("output.txt"));
    job.wait_until([&] {
      bytes = std::max(bytes, progress_bytes(path("whole.progress")).training);
      return false;
    });
    EXPECT_EQ(job.wait(kEndsWithin), 0) << read_text_file(path("output.txt"));
    return bytes;
  }

  bool cut_registration(const Plan& plan, const fs::path& folder) {
    test::LaunchedJob job(registration(plan.ranks, folder), path("output.txt"));
    const bool is_reached = reach(plan, job, folder.string() + ".progress");
    if (is_reached) cut_short(plan, job);
    const int exit_code = job.wait(kEndsWithin);
    if (!is_reached || fs::exists(folder / "summary.json")) return false;
    EXPECT_EQ(exit_code == 75, plan.cut == Cut::Usr1) << exit_code;
    EXPECT_NE(exit_code, 0);
    return true;
  }

  static void expect_whole_registration(const Plan& plan, const fs::path& folder) {
    const std::uint64_t kept = test::kept_records(folder.string() + ".progress");
    test::LaunchedJob job(registration(plan.other_ranks, folder), path("output.txt"));
    ASSERT_EQ(job.wait(kEndsWithin), 0) << read_text_file(path("output.txt"));
    EXPECT_NE(
        read_text_file(path("output.txt")).find("goes on after " + std::to_string(kept) + " of "),
        std::string::npos)
        << kept << " rows were kept";
    EXPECT_EQ(rows_without_seconds(folder), rows_);
    EXPECT_FALSE(fs::exists(folder.string() + ".progress"));
  }

  /// Cuts a run, sometimes cuts its continuation, too, and goes on to the end.
  void go_through(const Plan& plan) {
    SCOPED_TRACE(std::string(name_of(plan.stage)) + ", " + name_of(plan.cut) + ", " +
                 std::to_string(plan.ranks) + " ranks, then " + std::to_string(plan.other_ranks));
    const fs::path output = path("cut-" + std::to_string(cuts_made_) + ".out");
    const bool is_evaluation = plan.stage == Stage::Evaluate;
    constexpr int kMostTries = 10;
    for (int i = 0; i < kMostTries; ++i) {
      fs::remove_all(output);
      fs::remove_all(output.string() + ".progress");
      if (!(is_evaluation ? cut_registration(plan, output) : cut_field(plan, output))) continue;
      ++cuts_made_;
      if (plan.damage) {
        const std::string damaged =
            test::damage_a_file(output.string() + ".progress", *plan.damage, random_);
        SCOPED_TRACE(damaged);
        expect_same_or_refused(plan, output);
      } else if (is_evaluation) {
        expect_whole_registration(plan, output);
      } else {
        expect_whole(plan, output);
      }
      fs::remove_all(output);
      return;
    }
    const StageBytes stages = bytes_on(plan.ranks);
    ADD_FAILURE() << "the run was over too early " << kMostTries
                  << " times; bytes of its stages: " << stages.all_cast << ", "
                  << stages.all_trained << ", " << stages.all_encoded;
  }

  int other_than(int ranks) {
    int other = ranks;
    while (other == ranks) other = kRankCounts[random_() % kRankCounts.size()];
    return other;
  }

  /// Each plan draws from its own seed, so that a plan can be repeated alone.
  void draw_for(std::uint64_t plan) {
    constexpr std::uint64_t kMostPlans = 100'000;
    random_.seed(setting("AF_KILL_SEED", 1) * kMostPlans + plan);
  }

  std::mt19937_64 random_;
  std::uint64_t cuts_made_ = 0;
  std::uint64_t units_kept_ = 0;
  std::uint64_t iterations_kept_ = 0;
  std::uint64_t encoded_kept_ = 0;
  std::uint64_t refusals_ = 0;

 private:
  static inline test::ScratchFolder* folder_ = nullptr;
  static inline json undisturbed_;
  static inline std::string rows_;
};

TEST_F(KillMatrix, IsPrepared) {
  for (const char* name : {"AP.af.h5", "LAT.af.h5", "whole", "undisturbed.json"})
    EXPECT_TRUE(fs::exists(path(name))) << name;
}

class KillMatrixOfCuts : public KillMatrix,
                         public testing::WithParamInterface<std::tuple<Stage, Cut>> {};

/// Every stage meets every cut, and the rank counts take turns.
TEST_P(KillMatrixOfCuts, GoesOnToTheSameBytesOnAnotherRankCount) {
  const auto [stage, cut] = GetParam();
  const auto turn = static_cast<std::size_t>(stage) * kCuts.size() + static_cast<std::size_t>(cut);
  draw_for(turn);
  const int ranks = kRankCounts[(setting("AF_KILL_SEED", 1) + turn) % kRankCounts.size()];
  go_through({stage, cut, ranks, other_than(ranks), std::nullopt});
}
INSTANTIATE_TEST_SUITE_P(All,
                         KillMatrixOfCuts,
                         testing::Combine(testing::ValuesIn(kCastTrainEncode),
                                          testing::ValuesIn(kCuts)));

class KillMatrixOfDamages : public KillMatrix, public testing::WithParamInterface<test::Damage> {};

/// Every kind of damage comes once, or has its share of AF_KILLS. Stages, cuts and rank counts are
/// drawn.
TEST_P(KillMatrixOfDamages, MendsOrRefusesDamagedProgress) {
  constexpr std::size_t kStages = 4;
  const std::uint64_t kills = setting("AF_KILLS", test::kDamages.size());
  for (auto i = static_cast<std::uint64_t>(GetParam()); i < kills && !HasFailure();
       i += test::kDamages.size()) {
    draw_for(i);
    const int ranks = kRankCounts[random_() % kRankCounts.size()];
    go_through({static_cast<Stage>((setting("AF_KILL_SEED", 1) + i) % kStages),
                kCuts[random_() % kCuts.size()],
                ranks,
                other_than(ranks),
                GetParam()});
    std::cout << cuts_made_ << " runs cut short and damaged, " << refusals_ << " refused"
              << std::endl;
  }
}
INSTANTIATE_TEST_SUITE_P(All, KillMatrixOfDamages, testing::ValuesIn(test::kDamages));

/// Cuts AF_KILLS times. Stages, cuts and rank counts take turns, so that each of the 48
/// combinations comes up.
TEST_F(KillMatrix, LosesNothingOverManyKills) {
  const std::uint64_t kills = setting("AF_KILLS", 0);
  if (kills == 0) GTEST_SKIP() << "AF_KILLS=100 asks for it";
  constexpr std::size_t kStages = 4;
  for (std::uint64_t i = 0; i < kills && !HasFailure(); ++i) {
    draw_for(i);
    const int ranks = kRankCounts[i % kRankCounts.size()];
    const Cut cut = kCuts[i / kRankCounts.size() % kCuts.size()];
    const auto stage = static_cast<Stage>(i / (kRankCounts.size() * kCuts.size()) % kStages);
    go_through({stage, cut, ranks, other_than(ranks), std::nullopt});
  }
  std::cout << cuts_made_ << " runs cut short; kept and not done again: " << units_kept_
            << " cast units, " << iterations_kept_ << " iterations, " << encoded_kept_
            << " encoded units\n";
}

}  // namespace
}  // namespace af
