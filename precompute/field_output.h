// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "field/field_writing.h"
#include "precompute/build_phases.h"
#include "precompute/precompute_run.h"
#include "precompute/sized_field.h"

namespace af {

MpiIoHints mpi_io_hints(const PrecomputeOptions& options);

/// Collective. Checks the output before the work instead of after it. Throws as RunFolder::open()
/// and check_parallel_writing() do.
void open_output(const PrecomputeOptions& options, PrecomputeRun& run);

/// Collective. Encodes the tiles and writes the file, a field or an atlas, in turns, so that no
/// rank holds more than a round of indices. Then nothing is unfinished, and the terminal shows what
/// was made. Throws as FieldEncoder and write_field() do.
void write_encoded(const FieldBuild& build,
                   const SizedField& field,
                   CastPhase& cast,
                   const TrainedField& trained,
                   const OverflowChoice& choice,
                   PrecomputeRun& run);

}  // namespace af
