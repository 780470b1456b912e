// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace af {

/// Lifetime of MPI in a program: the constructor initialises it, the destructor finalises it. One
/// per process. Works with and without mpirun, and in a shell that srun started as its only task.
class MpiEnvironment {
 public:
  MpiEnvironment(int& argc, char**& argv);
  ~MpiEnvironment();
  MpiEnvironment(const MpiEnvironment&) = delete;
  MpiEnvironment& operator=(const MpiEnvironment&) = delete;

  /// What MPI says it supports: MPI_THREAD_SINGLE or more.
  [[nodiscard]] int thread_level() const { return thread_level_; }

  /// Ends every rank of the job at once with `exit_code`. Ends this process where MPI is not
  /// initialised.
  [[noreturn]] static void abort(int exit_code);

  /// From now on this rank can only end by abort(): a library is in a state in which finalising MPI
  /// would hang or crash.
  static void require_abort();
  [[nodiscard]] static bool is_abort_required();

 private:
  void init(int& argc, char**& argv);
  void init_alone(int& argc, char**& argv);

  int thread_level_ = 0;
};

/// Throws RemoteError when MPI's level is below MPI_THREAD_FUNNELED, since every rank is told the
/// same. Our processes have threads, of which only the first calls MPI.
/// \test MpiEnvironment.WithoutSupportOfThreadsIsAnError
void require_threads(int thread_level);

}  // namespace af
