// SPDX-License-Identifier: Apache-2.0
// Internal: gives the parallel HDF5 code the raw communicator. Nothing else may include it.
#pragma once

#include <mpi.h>

#include "parallel/communicator.h"

namespace af {

struct Communicator::Impl {
  MPI_Comm handle = MPI_COMM_NULL;  ///< null: Communicator::alone()
  bool is_owned = false;

  Impl(MPI_Comm communicator_handle, bool owned) : handle(communicator_handle), is_owned(owned) {}
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
};

}  // namespace af
