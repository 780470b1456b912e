// SPDX-License-Identifier: Apache-2.0
// How the programs describe their options to other programs: 3D Slicer, man, shells.
#include <fstream>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/sha256.h"
#include "programs/small_study.h"
#include "support/run_program.h"
#include "support/test_paths.h"

namespace af {
namespace {

using test::run_command;
using test::ScratchFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::string program(const std::string& name) {
  return std::string(AF_PROGRAM_FOLDER "/") + name;
}

/// Starts a program as Slicer does, from its --xml.
test::ProgramRun as_slicer(const std::string& name, const std::string& values) {
  return run_command("python3 " AF_SOURCE_FOLDER "/tests/programs/slicer_module.py " +
                     program(name) + " " + values);
}

bool is_installed(const std::string& tool) {
  return run_command("command -v " + tool).exit_code == 0;
}

TEST(SlicerModule, IsOneOfSlicersExecutionModel) {
  for (const char* name : {"af-drr", "af-register"}) {
    const test::ProgramRun run = as_slicer(name, "--check");
    EXPECT_EQ(run.exit_code, 0) << name << ": " << run.output;
  }
}

TEST(SlicerModule, NamesOptionsThatTheProgramReads) {
  for (const char* name : {"af-drr", "af-register"}) {
    const test::ProgramRun run = as_slicer(name, "--every-option");
    // All options at once contradict each other, which is an error of input. 2 would be one of
    // usage.
    EXPECT_EQ(run.exit_code, 3) << name << ": " << run.output;
  }
}

TEST(SlicerModule, MakesTheDrrThatTheCommandLineMakes) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  const std::string ct = (folder / "ct.nii.gz").string();
  const std::string rig = (folder / "rig.toml").string();
  const std::string typed = (folder / "typed.nrrd").string();
  const std::string filled_in = (folder / "filled_in.nrrd").string();
  const test::ProgramRun plain = run_command(program("af-drr") + " --ct " + ct + " --rig " + rig +
                                             " --camera AP --rotation-deg 3,0,-4 -o " + typed);
  ASSERT_EQ(plain.exit_code, 0) << plain.output;
  const test::ProgramRun module = as_slicer(
      "af-drr", "ct=" + ct + " rig=" + rig + " camera=AP rotation_deg=3,0,-4 output=" + filled_in);
  ASSERT_EQ(module.exit_code, 0) << module.output;
  EXPECT_EQ(sha256_of_file(filled_in), sha256_of_file(typed));
}

TEST(SlicerModule, RegistersFromATransformOfSlicer) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  const std::string start = (folder / "start.tfm").string();
  // ct_from_room: the case's nominal pose, moved by 1 mm.
  std::ofstream(start) << "#Insight Transform File V1.0\n#Transform 0\n"
                          "Transform: AffineTransform_double_3_3\n"
                          "Parameters: 1 0 0 0 1 0 0 0 1 -1 0 0\nFixedParameters: 0 0 0\n";
  const std::string output = (folder / "result").string();
  const test::ProgramRun run =
      as_slicer("af-register",
                "study=" + (folder / "study.toml").string() +
                    " renderer=raycast start_pose=" + start + " output=" + output);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_TRUE(std::filesystem::exists(output + "/result.tfm")) << run.output;
}

TEST(Option, IsFoundWithUnderscoresForDashes) {
  const test::ProgramRun known = run_command(program("af-drr") + " --rotation_deg=0,0,0");
  EXPECT_THAT(known.output, Not(HasSubstr("rotation_deg")));
  const test::ProgramRun unknown = run_command(program("af-drr") + " -o x.mha --no_such_option");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.output, HasSubstr("--no_such_option"));
}

TEST(Help, IsPrintedOnceByAJob) {
  const std::string command = program("af-inspect") + " --version";
  EXPECT_EQ(run_command(AF_MPIEXEC " -n 3 " + command).output, run_command(command).output);
}

TEST(ManPage, OfEveryProgramIsCleanRoff) {
  if (!is_installed("groff")) GTEST_SKIP() << "groff is not installed";
  for (const char* name : {"af-precompute",
                           "af-drr",
                           "af-simulate",
                           "af-scan",
                           "af-register",
                           "af-evaluate",
                           "af-inspect"}) {
    const test::ProgramRun run =
        run_command(program(name) + " --help-as man | groff -man -Tutf8 -ww -z");
    EXPECT_EQ(run.exit_code, 0) << run.output;
    EXPECT_EQ(run.output, "") << name;
  }
  const test::ProgramRun page =
      run_command(program("af-drr") + " --help-as man | groff -man -Tascii | col -b");
  EXPECT_THAT(page.output, AllOf(HasSubstr("--rotation-deg"), HasSubstr("EXIT STATUS")));
}

/// What bash offers to complete the last word of `line`.
std::string bash_offers(const std::string& name, const std::string& line) {
  const ScratchFolder folder;
  std::ofstream(folder / "ask.sh") << "source <(" << program(name) << " --help-as bash)\n"
                                   << "COMP_WORDS=(" << name << " " << line << ")\n"
                                   << "COMP_CWORD=$((${#COMP_WORDS[@]} - 1))\n"
                                   << "_" << name.substr(0, 2) << "_" << name.substr(3) << "\n"
                                   << "echo \"${COMPREPLY[*]}\"\n";
  return run_command("bash " + (folder / "ask.sh").string()).output;
}

TEST(BashCompletion, OffersOptionsAndTheNamesTheyChooseFrom) {
  EXPECT_EQ(bash_offers("af-drr", "--rot"), "--rotation-deg\n");
  EXPECT_EQ(bash_offers("af-register", "--renderer f"), "field\n");
  // A file is wanted, so bash's own completion takes over.
  EXPECT_EQ(bash_offers("af-register", "--study s"), "\n");
  EXPECT_EQ(bash_offers("af-evaluate", "image-q"), "image-quality\n");
  EXPECT_THAT(bash_offers("af-evaluate", "image-quality --pose-c"), HasSubstr("--pose-count"));
}

TEST(ZshCompletion, IsAFunctionThatZshReads) {
  if (!is_installed("zsh")) GTEST_SKIP() << "zsh is not installed";
  for (const char* name : {"af-precompute",
                           "af-drr",
                           "af-simulate",
                           "af-scan",
                           "af-register",
                           "af-evaluate",
                           "af-inspect"}) {
    const test::ProgramRun run = run_command(program(name) + " --help-as zsh | zsh -n /dev/stdin");
    EXPECT_EQ(run.exit_code, 0) << name << ": " << run.output;
    EXPECT_EQ(run.output, "") << name;
  }
}

}  // namespace
}  // namespace af
