// SPDX-License-Identifier: Apache-2.0
#include "field/mpi_io.h"

#include <system_error>

#include <mpi.h>

#include "base/error.h"
#include "field/hdf5_calls.h"
#include "ranks/mpi_group.h"

#ifndef H5_HAVE_PARALLEL
#error "ranks of MPI need parallel HDF5: link hdf5-openmpi (see common/cmake/ThirdParty.cmake)"
#endif

namespace af::hdf5 {

namespace {

/// Hints as MPI wants them.
class MpiInfo {
 public:
  explicit MpiInfo(const MpiIoHints& hints) {
    if (hints.empty()) return;
    MPI_Info_create(&info_);
    for (const auto& [key, value] : hints) MPI_Info_set(info_, key.c_str(), value.c_str());
  }
  ~MpiInfo() {
    if (info_ != MPI_INFO_NULL) MPI_Info_free(&info_);
  }
  MpiInfo(const MpiInfo&) = delete;
  MpiInfo& operator=(const MpiInfo&) = delete;

  [[nodiscard]] MPI_Info handle() const { return info_; }

 private:
  MPI_Info info_ = MPI_INFO_NULL;
};

}  // namespace

bool writes_by_mpi(const Communicator& communicator) {
  return mpi_handle(communicator) != MPI_COMM_NULL;
}

void lay_out_by_mpi(const std::filesystem::path& path, const MpiIoHints& hints) {
  if (hints.empty()) return;
  std::error_code ignored;
  std::filesystem::remove(path, ignored);
  const MpiInfo info(hints);
  MPI_File file = MPI_FILE_NULL;
  if (MPI_File_open(
          MPI_COMM_SELF, path.c_str(), MPI_MODE_CREATE | MPI_MODE_WRONLY, info.handle(), &file) !=
      MPI_SUCCESS)
    throw FileError(path.string(), "cannot be made by MPI-IO");
  MPI_File_close(&file);
}

void open_by_mpi(hid_t file_access, const Communicator& communicator, const MpiIoHints& hints) {
  const MpiInfo info(hints);
  checked(H5Pset_fapl_mpio(file_access, mpi_handle(communicator), info.handle()),
          "H5Pset_fapl_mpio");
}

void write_collectively(hid_t transfer) {
  checked(H5Pset_dxpl_mpio(transfer, H5FD_MPIO_COLLECTIVE), "H5Pset_dxpl_mpio");
}

}  // namespace af::hdf5
