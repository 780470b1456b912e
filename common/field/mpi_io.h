// SPDX-License-Identifier: Apache-2.0
// What HDF5 writes by MPI-IO. Internal to field_file. A build without MPI has no_mpi_io.cpp.
#pragma once

#include <filesystem>

#include <hdf5.h>

#include "field/field_writing.h"
#include "ranks/communicator.h"

namespace af::hdf5 {

/// Whether all ranks write to a file that they have open together. Otherwise rank 0 writes it.
bool writes_by_mpi(const Communicator& communicator);

/// For rank 0 alone. Hints on a file's layout (stripes) count only when it is created. If there are
/// hints, MPI-IO therefore creates the file, and HDF5 writes into it.
void lay_out_by_mpi(const std::filesystem::path& path, const MpiIoHints& hints);

/// Makes ranks open a file together.
void open_by_mpi(hid_t file_access, const Communicator& communicator, const MpiIoHints& hints);

/// Makes a transfer collective.
void write_collectively(hid_t transfer);

}  // namespace af::hdf5
