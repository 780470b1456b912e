// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "field_file/field_writing.h"
#include "parallel/communicator.h"

namespace af {

/// Collective. Writes about a megabyte to "PATH.io-test" as write_field() will write a field to
/// `path`, with ranks that have nothing to write, verifies it and removes it. A file system, HDF5
/// or MPI-IO that cannot do this is found before the work, not after it. FileError with their
/// versions.
void check_parallel_writing(const std::filesystem::path& path,
                            const Communicator& communicator,
                            const MpiIoHints& hints = {});
/// Collective. The same for a field of so many chunks that HDF5's index of them has to be held in a
/// larger metadata cache than its own: little data in as many chunks, but at most 131072. Does
/// nothing for smaller fields.
void check_writing_many_chunks(const FieldLattice& lattice,
                               const std::filesystem::path& path,
                               const Communicator& communicator,
                               const MpiIoHints& hints = {});

}  // namespace af
