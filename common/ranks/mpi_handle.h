// SPDX-License-Identifier: Apache-2.0
// Internal: gives the parallel HDF5 code the raw communicator. Nothing else may include it.
#pragma once

#include <mpi.h>

#include "ranks/communicator.h"

namespace af {

struct Communicator::Impl {
  MPI_Comm handle = MPI_COMM_NULL;  ///< null: Communicator::alone()
  /// Communicator::node(), once it was asked for. MPI_Finalize() frees it: to free it earlier would
  /// be a collective call at a place where the other ranks may never come.
  std::shared_ptr<Impl> node = nullptr;
};

}  // namespace af
