// SPDX-License-Identifier: Apache-2.0
#include "ranks/mpi_environment.h"

#include <atomic>
#include <cstdlib>
#include <string>

#include <mpi.h>

#include "base/error.h"
#include "ranks/launcher.h"

namespace af {

namespace {

std::atomic<bool> abort_required = false;

/// Hides a step of one task from MPI while this lives. Such a shell, by srun, needs no process
/// manager, but Open MPI looks for Slurm's and ends the program where there is none.
class HiddenStep {
 public:
  HiddenStep() {
    const char* const step = std::getenv(kStep);
    if (!is_only_task() || step == nullptr) return;
    step_ = step;
    unsetenv(kStep);
  }
  ~HiddenStep() {
    if (!step_.empty()) setenv(kStep, step_.c_str(), 1);
  }
  HiddenStep(const HiddenStep&) = delete;
  HiddenStep& operator=(const HiddenStep&) = delete;

 private:
  static constexpr const char* kStep = "SLURM_STEP_ID";
  std::string step_;
};

}  // namespace

MpiEnvironment::MpiEnvironment(int& argc, char**& argv) {
  // Without mpirun, Open MPI would start a daemon beside the program that could launch more
  // processes. We launch none, and programs start a third faster without it.
  setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  // Nor does it need a folder for them. All programs without mpirun would share one on a machine,
  // and one that ends removes it while another begins: of starts four at a time, 1 of 600 failed.
  constexpr const char* kMakesFolder = "OMPI_MCA_orte_create_session_dirs";
  const bool is_alone = !is_launched();
  const bool needs_no_folder = is_alone && std::getenv(kMakesFolder) == nullptr;
  if (needs_no_folder) setenv(kMakesFolder, "0", 0);
  // For shared file pointers, which we never use, Open MPI would make a file per rank beside each
  // file that ranks open together, or one in the folder that there is not. A setting by the user
  // stays.
  setenv("OMPI_MCA_sharedfp", is_alone ? "^lockedfile,sm" : "^lockedfile", 0);
  const bool names_process_manager = std::getenv("OMPI_MCA_pmix") != nullptr;
  const HiddenStep hidden_step;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &thread_level_);
  // Open MPI notes that there is no process manager, which would crash an mpirun that we or our
  // caller start.
  if (!names_process_manager) unsetenv("OMPI_MCA_pmix");
  // What this program starts may need its folder.
  if (needs_no_folder) unsetenv(kMakesFolder);
}

MpiEnvironment::~MpiEnvironment() {
  MPI_Finalize();
}

void MpiEnvironment::abort(int exit_code) {
  int is_initialized = 0;
  MPI_Initialized(&is_initialized);
  int ranks = 1;
  if (is_initialized != 0) MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  // With one rank there is nobody to notify.
  if (ranks > 1) MPI_Abort(MPI_COMM_WORLD, exit_code);
  std::_Exit(exit_code);
}

void MpiEnvironment::require_abort() {
  abort_required = true;
}

bool MpiEnvironment::is_abort_required() {
  return abort_required;
}

void require_threads(int thread_level) {
  if (thread_level >= MPI_THREAD_FUNNELED) return;
  throw RemoteError(ExitCode::Internal,
                    "MPI supports no processes with threads (MPI_Init_thread gives level " +
                        std::to_string(thread_level) + ", needed is MPI_THREAD_FUNNELED, " +
                        std::to_string(MPI_THREAD_FUNNELED) +
                        "): use an MPI that was built with them");
}

}  // namespace af
