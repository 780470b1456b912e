// SPDX-License-Identifier: Apache-2.0
// What rank 0 of a work queue spends, measured.
#pragma once

#include "benchmark/scale_simulation.h"
#include "parallel/communicator.h"

namespace af::benchmark {

/// Collective, two ranks or more. Rank 0's time for a request from seeing it to having answered it,
/// and per row that comes with it in blocks of 64; measured between ranks 0 and 1, as
/// parallel/work_queue.cpp does it. On rank 0 only.
void measure_messages(const Communicator& world, int repetitions, QueueCosts& costs);

/// What af-evaluate registration does with a row: unpacking, packing for the journal and appending
/// on rank 0 (receive_seconds), packing and appending where it was made (write_seconds).
void measure_rows(int repetitions, QueueCosts& costs);

}  // namespace af::benchmark
