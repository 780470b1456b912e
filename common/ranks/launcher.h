// SPDX-License-Identifier: Apache-2.0
// How this process was started, found without MPI from what launchers leave in its environment.
#pragma once

#include <string>

namespace af {

/// Whether mpirun, or srun with PMI or PMIx, started this process, so that MPI finds the others of
/// the job. The shell of a Slurm job, from sbatch or salloc, has only the job's variables.
[[nodiscard]] bool is_launched();

/// Whether this process speaks for the job. For programs that end before MPI begins.
[[nodiscard]] bool is_first_process();

/// Why this process may not run alone, and what to do. The reason is that srun started it, without
/// PMI, as one of several tasks, each of which would take itself for the whole job and write the
/// same files. Empty when it may. \test Launcher.RefusesOneOfSeveralTasksWithoutPmi
[[nodiscard]] std::string lone_task_problem();

/// Why a job of `joined` ranks may not continue, and what to do. The reason is that the launcher
/// started several processes that MPI has not joined. Empty when it may.
[[nodiscard]] std::string split_job_problem(int joined);

}  // namespace af
