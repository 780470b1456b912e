// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace af {

/// Lifetime of MPI in a program that a launcher started: the constructor initialises it and makes
/// the ranks of Communicator::world(), the destructor finalises it. One per process. In a build
/// without MPI (AF_MPI=OFF) it does nothing, and the world is this process alone.
class MpiEnvironment {
 public:
  MpiEnvironment(int& argc, char**& argv);
  ~MpiEnvironment();
  MpiEnvironment(const MpiEnvironment&) = delete;
  MpiEnvironment& operator=(const MpiEnvironment&) = delete;

  /// Collective. Throws RemoteError when MPI does not support processes with threads, since every
  /// rank is told the same. Ours have threads, of which only the first calls MPI.
  void require_threads() const;

 private:
  int thread_level_ = 0;
};

/// Throws as MpiEnvironment::require_threads() at a level below MPI_THREAD_FUNNELED.
/// \test MpiEnvironment.WithoutSupportOfThreadsIsAnError
void require_threads(int thread_level);

/// Name and version of the MPI that the program is linked with, e.g. "Open MPI v4.1.4"; "no MPI".
std::string mpi_version();

}  // namespace af
