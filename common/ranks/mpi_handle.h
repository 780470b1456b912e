// SPDX-License-Identifier: Apache-2.0
// Gives the parallel HDF5 code the raw communicator. Internal: nothing else may include it.
#pragma once

#include <mpi.h>

#include "ranks/communicator.h"

namespace af {

/// Its destructor frees no group of MPI. That is a collective call, and the last owner on a rank
/// may go at a place where the other ranks never come.
struct Communicator::Impl {
  MPI_Comm handle = MPI_COMM_NULL;  ///< null: Communicator::alone()
  /// Communicator::node(), once someone has asked for it. MPI_Finalize() frees it.
  std::shared_ptr<Impl> node = nullptr;
};

}  // namespace af
