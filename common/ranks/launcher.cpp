// SPDX-License-Identifier: Apache-2.0
#include "ranks/launcher.h"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "ranks/mpi_environment.h"

namespace af {

namespace {

/// "" when it is not set.
std::string variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// Number of tasks of the Slurm step that holds this process and has no PMI; "" when there is none.
std::string tasks_without_pmi() {
  return is_launched() ? "" : variable("SLURM_STEP_NUM_TASKS");
}

}  // namespace

bool is_launched() {
  constexpr std::array kSetByLaunchers = {"OMPI_COMM_WORLD_RANK",
                                          "PMIX_RANK",
                                          "PMI_RANK",
                                          "PMI_FD",
                                          "PMI_ID",
                                          "MV2_COMM_WORLD_RANK",
                                          "ALPS_APP_PE"};
  return std::any_of(kSetByLaunchers.begin(), kSetByLaunchers.end(), [](const char* name) {
    return std::getenv(name) != nullptr;
  });
}

bool is_first_process() {
  // mpirun's variables take precedence in a shell that srun started.
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"})
    if (const std::string rank = variable(name); !rank.empty()) return rank == "0";
  return true;
}

std::string lone_task_problem() {
  const std::string tasks = tasks_without_pmi();
  if (tasks.empty() || tasks == "1") return {};
  return "srun started this process as one of several tasks (SLURM_STEP_NUM_TASKS=" + tasks +
         ", SLURM_PROCID=" + variable("SLURM_PROCID") +
         ") without PMI, by which they would find each other; each would do the whole job: use "
         "srun --mpi=pmix or mpirun, or srun -n 1; where each task does a job of its own, unset "
         "SLURM_STEP_NUM_TASKS";
}

std::string split_job_problem(int joined) {
  for (const char* name :
       {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS"}) {
    const std::string processes = variable(name);
    if (processes.empty()) continue;
    if (joined > 1 || processes == "1") return {};
    return "a launcher started this process as one of several (" + std::string(name) + "=" +
           processes +
           "), which do not find each other; each would do the whole job: use the mpirun of the "
           "MPI that the programs are linked with (" +
           mpi_version() + "), or --processes on one machine";
  }
  return {};
}

}  // namespace af
