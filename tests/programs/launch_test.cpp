// SPDX-License-Identifier: Apache-2.0
// The ways to start programs: by themselves, by mpirun, as tasks of a step of Slurm.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "programs/small_study.h"
#include "support/run_program.h"
#include "support/test_paths.h"

namespace af {
namespace {

using test::ProgramRun;
using test::run_command;
using test::ScratchFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// A command as without a launcher, whatever launched these tests.
constexpr const char* kNoLauncher =
    "env -u OMPI_COMM_WORLD_RANK -u PMIX_RANK -u PMI_RANK -u PMI_FD -u PMI_ID"
    " -u SLURM_STEP_NUM_TASKS ";
/// With this in its environment, a process ends in MPI_Init().
constexpr const char* kBrokenMpi = "OMPI_MCA_btl=doesnotexist ";
constexpr const char* kMpirun = AF_MPIEXEC " -n 1 ";
constexpr const char* kInspection = "af-inspect c-arm-12in";

std::string program(const std::string& command) {
  return AF_PROGRAM_FOLDER "/" + command;
}

ProgramRun run_alone(const std::string& command) {
  return run_command(kNoLauncher + command);
}

/// The small study in a folder of its own.
class NoLauncher : public testing::Test {
 protected:
  void SetUp() override { test::write_small_study(folder_.path()); }

  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_ / name).string();
  }
  [[nodiscard]] std::string precompute(const std::string& options) const {
    return program("af-precompute --study ") + path("study.toml") + " --camera AP --slabs 1 " +
           options;
  }
  [[nodiscard]] std::string smallest_field() const {
    return precompute("--uv-nodes 4 --st-nodes 16 --codewords 4 -o " + path("smallest.af.h5"));
  }

 private:
  ScratchFolder folder_;
};

TEST_F(NoLauncher, StartsNoMpi) {
  const std::string field = path("AP.af.h5");
  const ProgramRun made = run_alone(
      kBrokenMpi +
      precompute("--max-rotation-deg 15 --max-translation-mm 12 --uv-nodes 20 --st-nodes 64 "
                 "--codewords 512 -o " +
                 field));
  ASSERT_EQ(made.exit_code, 0) << made.output;
  const std::string study = " --study " + path("study.toml");
  const std::string by_casting = study + " --renderer raycast";
  for (const std::string& command :
       {std::string(kInspection),
        "af-inspect " + path("study.toml") + " " + field,
        "af-drr --field " + field + " -o " + path("drr.nrrd"),
        "af-register" + by_casting + " --max-evaluations 20 -o " + path("register"),
        "af-evaluate registration" + by_casting +
            " --preset paper --intervals 1 --starts-per-interval 2 -o " + path("evaluate"),
        "af-evaluate image-quality --field " + field + " --ct " + path("ct.nii.gz") +
            " --pose-count 2 -o " + path("image-quality"),
        "af-simulate --phantom spine --phantom-voxel-mm 4 -o " + path("simulated")}) {
    const ProgramRun run = run_alone(kBrokenMpi + program(command));
    EXPECT_EQ(run.exit_code, 0) << command << ": " << run.output;
    EXPECT_THAT(run.output, Not(HasSubstr("MPI_"))) << command;
  }
  const ProgramRun scan =
      run_alone(kBrokenMpi + program("af-scan --scan " + path("no.toml") + " -o " + path("scan")));
  EXPECT_EQ(scan.exit_code, 4) << scan.output;
  EXPECT_THAT(scan.output, HasSubstr("no.toml"));
}

TEST(NoLauncherProgram, UsageErrorsStartNoMpi) {
  const ProgramRun run = run_alone(kBrokenMpi + program("af-inspect --no-such-option"));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.output, HasSubstr("--no-such-option"));
}

TEST(NoLauncherProgram, RunsInTheShellOfASlurmJob) {
  const ProgramRun run =
      run_alone(std::string(kBrokenMpi) +
                "SLURM_JOB_ID=123 SLURM_NTASKS=3 SLURM_PROCID=0 SLURM_NODELIST=$(hostname) " +
                program(kInspection));
  EXPECT_EQ(run.exit_code, 0) << run.output;
}

TEST(Mpirun, StartsMpi) {
  EXPECT_EQ(run_command(kMpirun + program(kInspection)).exit_code, 0);
  EXPECT_NE(run_command(std::string(kBrokenMpi) + kMpirun + program(kInspection)).exit_code, 0);
}

/// Runs a command as one of `tasks` tasks of a Slurm step without a process manager. A shell by
/// `srun --pty` is such a step where MpiDefault is none.
ProgramRun in_step(int tasks, const std::string& command, int task = 0) {
  const std::string n = std::to_string(tasks);
  const std::string i = std::to_string(task);
  return run_alone(
      "SLURM_JOB_ID=123 SLURM_JOBID=123 SLURM_STEP_ID=0 SLURM_STEPID=0"
      " SLURM_NTASKS=" +
      n + " SLURM_NPROCS=" + n + " SLURM_STEP_NUM_TASKS=" + n + " SLURM_PROCID=" + i +
      " SLURM_LOCALID=" + i +
      " SLURM_NNODES=1 SLURM_JOB_NUM_NODES=1"
      " SLURM_TASKS_PER_NODE=" +
      n + " SLURM_STEP_TASKS_PER_NODE=" + n +
      " SLURM_NODELIST=$(hostname) SLURM_JOB_NODELIST=$(hostname)"
      " SLURM_STEP_NODELIST=$(hostname) " +
      command);
}

TEST(SlurmStep, HelpNeedsNoMpi) {
  for (const char* command : {"af-drr --help",
                              "af-drr --xml",
                              "af-evaluate --help",
                              "af-evaluate --version",
                              "af-inspect --help-as man",
                              "af-precompute --help",
                              "af-register --list measures"})
    for (const int tasks : {1, 3}) {
      const ProgramRun run = in_step(tasks, kBrokenMpi + program(command));
      EXPECT_EQ(run.exit_code, 0) << run.output;
      EXPECT_EQ(run.output, run_alone(program(command)).output);
    }
}

TEST(SlurmStep, OfOneTaskRunsAProgram) {
  const ProgramRun one = in_step(1, program(kInspection));
  EXPECT_EQ(one.exit_code, 0) << one.output;
  EXPECT_EQ(one.output, run_alone(program(kInspection)).output);
  EXPECT_EQ(in_step(1, program("af-inspect") + " --no-such-option").exit_code, 2);
}

TEST_F(NoLauncher, AFieldIsWrittenByTheOnlyTaskOfAStep) {
  const ProgramRun run = in_step(1, smallest_field());
  EXPECT_EQ(run.exit_code, 0) << run.output;
}

TEST(SlurmStep, OfSeveralTasksWithoutPmiIsRefusedByTheFirst) {
  for (const char* command : {kInspection, "af-inspect --no-such-option", "af-precompute"}) {
    const ProgramRun first = in_step(3, program(command));
    EXPECT_EQ(first.exit_code, 2);
    EXPECT_THAT(first.output,
                AllOf(HasSubstr("SLURM_STEP_NUM_TASKS=3, SLURM_PROCID=0"),
                      HasSubstr("srun --mpi=pmix or mpirun")));
  }
  const ProgramRun second = in_step(3, program(kInspection), 1);
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_EQ(second.output, "");
}

}  // namespace
}  // namespace af
