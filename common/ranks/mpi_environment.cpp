// SPDX-License-Identifier: Apache-2.0
#include "ranks/mpi_environment.h"

#include <algorithm>
#include <cstdlib>
#include <memory>

#include "base/error.h"
#include "ranks/mpi_group.h"

namespace af {

MpiEnvironment::MpiEnvironment(int& argc, char**& argv) {
  // For shared file pointers, which we never use, Open MPI would create a file per rank beside each
  // file that ranks open together, or try to in a folder that does not exist. A setting by the user
  // is kept.
  setenv("OMPI_MCA_sharedfp", "^lockedfile", 0);
  const bool names_process_manager = std::getenv("OMPI_MCA_pmix") != nullptr;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &thread_level_);
  // Open MPI notes that there is no process manager. That would crash an mpirun that we or our
  // caller start.
  if (!names_process_manager) unsetenv("OMPI_MCA_pmix");
  ranks_of_job() = std::make_shared<MpiGroup>(MPI_COMM_WORLD);
}

MpiEnvironment::~MpiEnvironment() {
  ranks_of_job() = nullptr;
  MPI_Finalize();
}

void MpiEnvironment::require_threads() const {
  af::require_threads(thread_level_);
}

void require_threads(int thread_level) {
  if (thread_level >= MPI_THREAD_FUNNELED) return;
  throw RemoteError(ExitCode::Internal,
                    "MPI supports no processes with threads (MPI_Init_thread gives level " +
                        std::to_string(thread_level) + ", needed is MPI_THREAD_FUNNELED, " +
                        std::to_string(MPI_THREAD_FUNNELED) +
                        "): use an MPI that was built with them");
}

std::string mpi_version() {
  std::string version(MPI_MAX_LIBRARY_VERSION_STRING, '\0');
  int length = 0;
  MPI_Get_library_version(version.data(), &length);
  version.resize(static_cast<std::size_t>(length));
  version.resize(std::min(version.size(), version.find_first_of(",\n")));
  return version;
}

}  // namespace af
