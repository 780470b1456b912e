// SPDX-License-Identifier: Apache-2.0
// Stands for mpi_io.cpp in a build without MPI (AF_MPI=OFF).
#include "base/error.h"
#include "field/mpi_io.h"

namespace af::hdf5 {

namespace {

void is_not_reached() {
  check(false, "a build without MPI has no ranks that write together");
}

}  // namespace

bool writes_by_mpi(const Communicator& /*communicator*/) {
  return false;
}

void lay_out_by_mpi(const std::filesystem::path& /*path*/, const MpiIoHints& /*hints*/) {
  is_not_reached();
}

void open_by_mpi(hid_t /*file_access*/,
                 const Communicator& /*communicator*/,
                 const MpiIoHints& /*hints*/) {
  is_not_reached();
}

void write_collectively(hid_t /*transfer*/) {
  is_not_reached();
}

}  // namespace af::hdf5
