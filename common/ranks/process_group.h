// SPDX-License-Identifier: Apache-2.0
// Ranks without MPI: copies of this process on this machine (option --processes).
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "base/described_fields.h"

namespace af {

/// The most processes that one program may become.
inline constexpr int kMostProcesses = 256;

/// Lifetime of copies of this process that share its work, rank 0 being this one. The constructor
/// makes them (fork) and the ranks of Communicator::world(). It is to be called before the process
/// has threads, open files of HDF5 or locks. In each copy it returns as well; all then run the same
/// program, as under mpirun. The destructor of rank 0 waits for the others to end.
/// When one of them is killed, `on_loss`, which must end the process, is called on rank 0 with a
/// text that names it. They end with this process, however it ends.
class ProcessGroup {
 public:
  /// `count`: from 1, which makes none, to kMostProcesses. Throws std::system_error where the
  /// system has no room for them.
  ProcessGroup(int count, std::function<void(const std::string& text)> on_loss);
  ~ProcessGroup();
  ProcessGroup(const ProcessGroup&) = delete;
  ProcessGroup& operator=(const ProcessGroup&) = delete;

 private:
  class Watch;
  std::unique_ptr<Watch> watch_;  ///< of rank 0
};

/// Sends a signal to the other processes of the group, from rank 0. A signal handler may call it.
void pass_on_signal(int signal) noexcept;

/// How many processes a program is to become. The command line sets it (cli/run_limits.h).
struct LocalProcesses {
  int count = 1;

  void describe(Fields& field);
};
LocalProcesses& local_processes();

}  // namespace af
