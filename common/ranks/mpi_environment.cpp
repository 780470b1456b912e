// SPDX-License-Identifier: Apache-2.0
#include "ranks/mpi_environment.h"

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <unistd.h>

#include <mpi.h>

#include "base/error.h"
#include "ranks/launcher.h"

namespace af {

namespace {

std::atomic<bool> abort_required = false;

/// Gives an environment variable another value, or none, while this lives.
class VariableMeanwhile {
 public:
  VariableMeanwhile(const char* name, const std::optional<std::string>& value) : name_(name) {
    if (const char* const before = std::getenv(name)) before_ = before;
    set(value);
  }
  ~VariableMeanwhile() { set(before_); }
  VariableMeanwhile(const VariableMeanwhile&) = delete;
  VariableMeanwhile& operator=(const VariableMeanwhile&) = delete;

 private:
  void set(const std::optional<std::string>& value) const {
    if (value)
      setenv(name_, value->c_str(), 1);
    else
      unsetenv(name_);
  }

  const char* name_;
  std::optional<std::string> before_;
};

bool is_usable_folder(const std::string& folder) {
  std::error_code ignored;
  return std::filesystem::is_directory(folder, ignored) && access(folder.c_str(), W_OK | X_OK) == 0;
}

/// The first of the user's folder and the usual ones that can hold files. The user's when none can.
std::optional<std::string> usable_temporary_folder() {
  std::optional<std::string> stated;
  if (const char* const folder = std::getenv("TMPDIR")) stated = folder;
  for (const std::string& folder :
       {stated.value_or("/tmp"), std::string("/tmp"), std::string("/dev/shm")})
    if (is_usable_folder(folder)) return folder;
  return stated;
}

}  // namespace

MpiEnvironment::MpiEnvironment(int& argc, char**& argv) {
  // Without mpirun, Open MPI would start a daemon beside the program that could launch more
  // processes. We launch none, and programs start a third faster without it.
  setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  // For shared file pointers, which we never use, Open MPI would create a file per rank beside each
  // file that ranks open together, or try to in a folder that does not exist. A setting by the user
  // is kept.
  setenv("OMPI_MCA_sharedfp", is_launched() ? "^lockedfile" : "^lockedfile,sm", 0);
  if (is_launched())
    init(argc, argv);
  else
    init_alone(argc, argv);
}

void MpiEnvironment::init(int& argc, char**& argv) {
  const bool names_process_manager = std::getenv("OMPI_MCA_pmix") != nullptr;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &thread_level_);
  // Open MPI notes that there is no process manager. That would crash an mpirun that we or our
  // caller start.
  if (!names_process_manager) unsetenv("OMPI_MCA_pmix");
}

void MpiEnvironment::init_alone(int& argc, char**& argv) {
  // Alone, Open MPI needs no folder for the job. All programs without mpirun would share one on a
  // machine, and one that ends removes it while another begins: with four starts at a time, 1 of
  // 600 failed. What this program starts may need its folder.
  constexpr const char* kMakesFolder = "OMPI_MCA_orte_create_session_dirs";
  const char* const makes_folder = std::getenv(kMakesFolder);
  const VariableMeanwhile no_folder(kMakesFolder, makes_folder == nullptr ? "0" : makes_folder);
  // Open MPI 5 makes one even so, and crashes where it cannot.
  const VariableMeanwhile temporary_folder("TMPDIR", usable_temporary_folder());
  // The shell of a one-task step by srun needs no process manager. Open MPI looks for Slurm's, and
  // ends the program where there is none.
  constexpr const char* kStep = "SLURM_STEP_ID";
  const char* const step = std::getenv(kStep);
  const VariableMeanwhile hidden_step(
      kStep, is_only_task() || step == nullptr ? std::nullopt : std::optional<std::string>(step));
  init(argc, argv);
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
