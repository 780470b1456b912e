// SPDX-License-Identifier: Apache-2.0
// When two jobs write the same output, the second is refused by name, whichever program it is. The
// first writes its whole output undisturbed.
#include <csignal>
#include <filesystem>
#include <sstream>
#include <string>
#include <unistd.h>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/output_file.h"
#include "files/output_lock.h"
#include "programs/small_study.h"
#include "study/pose_file.h"
#include "support/launched_job.h"
#include "support/run_program.h"
#include "support/test_paths.h"

namespace af {
namespace {

using testing::HasSubstr;

constexpr const char* kScan = R"(name = "balls"
source_to_axis_mm = 200.0
axis_to_detector_mm = 100.0
pixel_spacing_mm = [0.9, 0.9]
size_px = [72, 60]
rotation_axis = "rows"
view_count = 120
first_angle_deg = 10.0
step_deg = 3.0
files = "p{:03}.png"
xray_domain = "intensity"
)";

class OutputLocks : public testing::Test {
 protected:
  OutputLocks() {
    test::write_small_study(folder_.path());
    write_text_file(folder_ / "scan.toml", kScan);
    write_text_file(folder_ / "pose.toml", pose_to_toml(RigidTransform::Identity()));
  }

  std::string path(const std::string& name) { return (folder_ / name).string(); }
  std::string text(const std::string& name) { return read_text_file(folder_ / name); }
  static std::string line(const std::string& arguments) {
    return AF_PROGRAM_FOLDER "/" + arguments;
  }
  std::string simulate(int seed, const std::string& folder) {
    return "af-simulate --phantom head --phantom-voxel-mm 5 --rig " + path("rig.toml") +
           " --seed " + std::to_string(seed) + " -o " + path(folder);
  }
  std::string drr(int offset_mm, const std::string& file) {
    return "af-drr --ct " + path("ct.nii.gz") + " --rig " + path("rig.toml") +
           " --camera AP --translation-mm=" + std::to_string(offset_mm) + ",0,0 -o " + path(file);
  }

  /// Starts a job, and stops it once its lock says who it is. Another job must then be refused. At
  /// last the first may end.
  void expect_second_is_refused(const std::string& first_arguments,
                                const std::string& second_arguments,
                                const std::string& lock) {
    std::vector<std::string> words;
    std::istringstream rest(line(first_arguments));
    for (std::string word; rest >> word;) words.push_back(word);
    test::LaunchedJob first(words, folder_ / "said.txt");
    std::error_code none_yet;
    ASSERT_TRUE(first.wait_until([&] {
      const auto bytes = std::filesystem::file_size(path(lock), none_yet);
      return !none_yet && bytes > 0;
    }));
    kill(first.launcher(), SIGSTOP);
    const test::ProgramRun second = test::run_command(line(second_arguments));
    kill(first.launcher(), SIGCONT);
    EXPECT_EQ(second.exit_code, 3) << second.output;
    EXPECT_THAT(
        second.output,
        HasSubstr("another job is writing it: process " + std::to_string(first.launcher())));
    EXPECT_EQ(first.wait(std::chrono::minutes(5)), 0) << text("said.txt");
  }

  test::ScratchFolder folder_;
};

TEST_F(OutputLocks, AFolderOfTwoSimulationsIsTheFirstOnes) {
  ASSERT_EQ(test::run_command(line(simulate(3, "alone"))).exit_code, 0);
  expect_second_is_refused(simulate(3, "study"), simulate(4, "study"), "study.lock");
  for (const char* file : {"AP.mha", "LAT.mha", "truth.toml", "study.toml"})
    EXPECT_EQ(text(std::string("study/") + file), text(std::string("alone/") + file)) << file;
  for (const char* left : {"study.partial", "study.lock"})
    EXPECT_FALSE(std::filesystem::exists(path(left))) << left;
}

TEST_F(OutputLocks, AFileOfTwoDrrsIsTheFirstOnes) {
  ASSERT_EQ(test::run_command(line(drr(3, "alone.mha"))).exit_code, 0);
  expect_second_is_refused(drr(3, "drr.mha"), drr(4, "drr.mha"), "drr.mha.lock");
  EXPECT_EQ(text("drr.mha"), text("alone.mha"));
  EXPECT_FALSE(std::filesystem::exists(path("drr.mha.lock")));
}

TEST_F(OutputLocks, EveryProgramRefusesWhatAnotherJobWrites) {
  const OutputLock folder_lock(folder_ / "taken");
  const OutputLock field_lock(folder_ / "taken.af.h5");
  const OutputLock image_lock(folder_ / "taken.mha");
  const OutputLock text_lock(folder_ / "taken.toml");
  const std::string study = path("study.toml");
  const std::vector<std::string> commands = {
      simulate(3, "taken"),
      "af-scan --scan " + path("scan.toml") + " -o " + path("taken"),
      drr(3, "taken.mha"),
      "af-precompute --study " + study +
          " --camera AP --max-rotation-deg 4 --max-translation-mm 4"
          " --uv-nodes 8 --st-nodes 16 --codewords 16 -o " +
          path("taken.af.h5"),
      "af-register --study " + study + " --renderer raycast -o " + path("taken"),
      "af-inspect " + study + " --pictures " + path("taken")};
  for (const std::string& command : commands) {
    const test::ProgramRun run = test::run_command(line(command));
    EXPECT_EQ(run.exit_code, 3) << command << '\n' << run.output;
    EXPECT_THAT(
        run.output,
        HasSubstr("another job is writing it: process " + std::to_string(getpid()) + " on "));
  }
  for (const char* file : {"taken.af.h5", "taken.mha", "taken.toml", "taken/result.json"})
    EXPECT_FALSE(std::filesystem::exists(folder_ / file)) << file;
}

TEST_F(OutputLocks, OfAnotherHostAreHeededUnlessToldOtherwise) {
  write_text_file(folder_ / "drr.mha.lock", "process 12 on elsewhere, since 2026\n");
  const test::ProgramRun refused = test::run_command(line(drr(3, "drr.mha")));
  EXPECT_EQ(refused.exit_code, 3) << refused.output;
  EXPECT_THAT(refused.output, HasSubstr("process 12 on elsewhere"));
  const test::ProgramRun run = test::run_command(line(drr(3, "drr.mha") + " --no-lock"));
  EXPECT_EQ(run.exit_code, 0) << run.output;
}

}  // namespace
}  // namespace af
