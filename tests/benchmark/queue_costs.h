// SPDX-License-Identifier: Apache-2.0
// Measures the time that rank 0 of a work queue spends.
#pragma once

#include "benchmark/scale_simulation.h"
#include "ranks/communicator.h"

namespace af::benchmark {

/// Collective, on two ranks or more; only rank 0 has the result. Measures rank 0's time for a
/// request, from seeing it to having answered it, and per row that comes with it in blocks of 64.
/// Ranks 0 and 1 talk as in ranks/work_queue.cpp.
void measure_messages(const Communicator& world, int repetitions, QueueCosts& costs);

/// Times what happens to a row of registrations. write_seconds: the rank packs it and appends it to
/// its own shard, as af-evaluate does. receive_seconds: if all rows were sent to rank 0, it would
/// unpack, pack and append them.
void measure_rows(int repetitions, QueueCosts& costs);

}  // namespace af::benchmark
