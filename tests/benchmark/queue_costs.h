// SPDX-License-Identifier: Apache-2.0
// What rank 0 of a work queue spends, measured.
#pragma once

#include "benchmark/scale_simulation.h"
#include "ranks/communicator.h"

namespace af::benchmark {

/// Collective, two ranks or more. Rank 0's time for a request from seeing it to having answered it,
/// and per row that comes with it in blocks of 64; measured between ranks 0 and 1, as
/// ranks/work_queue.cpp does it. On rank 0 only.
void measure_messages(const Communicator& world, int repetitions, QueueCosts& costs);

/// What becomes of a row of registrations: packing and appending to the rank's own shard, as
/// af-evaluate does it (write_seconds), or, were all rows sent to rank 0, unpacking, packing and
/// appending there (receive_seconds).
void measure_rows(int repetitions, QueueCosts& costs);

}  // namespace af::benchmark
