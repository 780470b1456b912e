// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "field/field_writing.h"
#include "ranks/communicator.h"

namespace af {

/// Collective. Writes about a megabyte to "PATH.io-test" as write_field() will write a field to
/// `path`, including ranks with nothing to write, verifies it and removes it. A file system, HDF5
/// or MPI-IO that cannot do this is found before the work, not after it. FileError names their
/// versions.
void check_parallel_writing(const std::filesystem::path& path,
                            const Communicator& communicator,
                            const MpiIoHints& hints = {});
/// Collective. The same for a field with so many chunks that HDF5 needs more than its default
/// metadata cache for their index: writes little data in as many chunks, but at most 131072. Does
/// nothing for smaller fields.
void check_writing_many_chunks(const FieldLattice& lattice,
                               const std::filesystem::path& path,
                               const Communicator& communicator,
                               const MpiIoHints& hints = {});

}  // namespace af
