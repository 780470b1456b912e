// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "field/field_writing.h"
#include "ranks/communicator.h"

namespace af {

/// Collective. Writes about a megabyte to "PATH.io-test" as write_field() will write a field to
/// `path`, verifies it and removes it. Ranks with nothing to write take part. A file system, HDF5
/// or MPI-IO that cannot do this is thus found before the work, not after it. FileError names their
/// versions.
void check_parallel_writing(const std::filesystem::path& path,
                            const Communicator& communicator,
                            const MpiIoHints& hints = {});
/// Collective. The same for a field with so many chunks that their index exceeds HDF5's default
/// metadata cache. Writes little data in as many chunks, but at most 131072. Does nothing for
/// smaller fields.
void check_writing_many_chunks(const FieldLattice& lattice,
                               const std::filesystem::path& path,
                               const Communicator& communicator,
                               const MpiIoHints& hints = {});

}  // namespace af
