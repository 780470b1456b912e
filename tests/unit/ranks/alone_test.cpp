// SPDX-License-Identifier: Apache-2.0
// What a process does by itself, where MPI is not initialised.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "ranks/communicator.h"
#include "ranks/launcher.h"
#include "ranks/terminal.h"
#include "ranks/work_queue.h"

namespace af {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

/// Tests begin without a launcher, whatever started them.
class Launcher : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"OMPI_COMM_WORLD_RANK",
                             "PMIX_RANK",
                             "PMI_RANK",
                             "PMI_FD",
                             "PMI_ID",
                             "PMI_SIZE",
                             "OMPI_COMM_WORLD_SIZE",
                             "MV2_COMM_WORLD_RANK",
                             "MV2_COMM_WORLD_SIZE",
                             "ALPS_APP_PE",
                             "SLURM_PROCID",
                             "SLURM_STEP_NUM_TASKS"})
      unsetenv(name);
  }
  static void set(const char* name, const char* value) { setenv(name, value, 1); }
};

TEST_F(Launcher, IsNoShellOfASlurmJob) {
  set("SLURM_JOB_ID", "7");
  set("SLURM_NTASKS", "3");
  set("SLURM_PROCID", "0");
  EXPECT_FALSE(is_launched());
  EXPECT_TRUE(is_first_process());
  EXPECT_EQ(lone_task_problem(), "");
}

TEST_F(Launcher, RefusesOneOfSeveralTasksWithoutPmi) {
  set("SLURM_STEP_NUM_TASKS", "3");
  set("SLURM_PROCID", "2");
  EXPECT_FALSE(is_first_process());
  EXPECT_THAT(lone_task_problem(),
              AllOf(HasSubstr("SLURM_STEP_NUM_TASKS=3"),
                    HasSubstr("SLURM_PROCID=2"),
                    HasSubstr("srun --mpi=pmix or mpirun")));
  set("PMIX_RANK", "2");
  EXPECT_TRUE(is_launched());
  EXPECT_EQ(lone_task_problem(), "");
}

TEST_F(Launcher, LeavesTheOnlyTaskAlone) {
  set("SLURM_STEP_NUM_TASKS", "1");
  set("SLURM_PROCID", "0");
  EXPECT_EQ(lone_task_problem(), "");
}

TEST_F(Launcher, IsMpirunWithinAStep) {
  set("SLURM_STEP_NUM_TASKS", "2");
  set("SLURM_PROCID", "0");
  set("OMPI_COMM_WORLD_RANK", "3");
  EXPECT_TRUE(is_launched());
  EXPECT_FALSE(is_first_process());
  EXPECT_EQ(lone_task_problem(), "");
}

TEST_F(Launcher, RefusesProcessesThatMpiHasNotJoined) {
  EXPECT_EQ(split_job_problem(1), "");
  set("PMI_SIZE", "1");
  EXPECT_EQ(split_job_problem(1), "");
  set("PMI_SIZE", "4");
  EXPECT_EQ(split_job_problem(4), "");
  EXPECT_THAT(split_job_problem(1), HasSubstr("PMI_SIZE=4"));
}

// As srun --mpi=pmix starts programs that were built without MPI.
TEST_F(Launcher, RefusesTasksWithPmiThatMpiHasNotJoined) {
  set("PMIX_RANK", "1");
  set("SLURM_STEP_NUM_TASKS", "2");
  EXPECT_THAT(split_job_problem(1),
              AllOf(HasSubstr("SLURM_STEP_NUM_TASKS=2"), HasSubstr("--processes")));
  EXPECT_EQ(split_job_problem(2), "");
}

TEST(WorkQueueAlone, HandsOutEveryItemInOrder) {
  std::vector<std::int64_t> items;
  std::int64_t reported = 0;
  for_each_item(
      Communicator::alone(),
      4,
      [&](std::int64_t item) { items.push_back(item); },
      [&](std::int64_t done) { reported = done; });
  EXPECT_THAT(items, ElementsAre(0, 1, 2, 3));
  EXPECT_EQ(reported, 4);
}

TEST(WorkQueueAlone, EndsWithTheItemThatFails) {
  std::vector<std::int64_t> items;
  EXPECT_THROW(for_each_item(Communicator::alone(),
                             4,
                             [&](std::int64_t item) {
                               items.push_back(item);
                               if (item == 1) throw FileError("field.h5", "gone");
                             }),
               RemoteError);
  EXPECT_THAT(items, ElementsAre(0, 1));
}

TEST(TerminalAlone, GivesEveryWarningOnce) {
  testing::internal::CaptureStderr();
  for (const char* text : {"ct.mha: odd", "ct.mha: odd", "xray.mha: odd", "ct.mha: odd"})
    warn(Communicator::alone(), text);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "warning: ct.mha: odd\nwarning: xray.mha: odd\n");
}

}  // namespace
}  // namespace af
