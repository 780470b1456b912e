// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace af {

/// Lifetime of MPI in a program: initialised by the constructor, finalised by the destructor. One
/// per process, made first thing in main. Works with and without mpirun.
class MpiEnvironment {
 public:
  MpiEnvironment(int& argc, char**& argv);
  ~MpiEnvironment();
  MpiEnvironment(const MpiEnvironment&) = delete;
  MpiEnvironment& operator=(const MpiEnvironment&) = delete;

  /// Ends every rank of the job with `exit_code`; does not return when there is more than one rank.
  static void abort(int exit_code);
};

}  // namespace af
