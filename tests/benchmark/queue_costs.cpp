// SPDX-License-Identifier: Apache-2.0
#include "benchmark/queue_costs.h"

#include <array>
#include <cstdint>
#include <vector>

#include <mpi.h>

#include "base/stored_bytes.h"
#include "benchmark/alternating_rounds.h"
#include "evaluate/registration/registration_rows.h"
#include "ranks/mpi_group.h"
#include "ranks/progress_journal.h"
#include "ranks/stop_request.h"
#include "support/test_paths.h"

namespace af::benchmark {

namespace {

constexpr int kRequestTag = 21;
constexpr int kGrantTag = 22;
using evaluation::RegistrationRow;

RegistrationRow some_row(std::int64_t index) {
  RegistrationRow row;
  row.case_name = "skull-01";
  row.renderer = "field";
  row.start_index = index;
  row.start_deg_mm = row.final_deg_mm = {0.1, -1.0 / 3, 2.0 / 7, 4.25, -5.1, 6.7};
  row.initial_tre_mm = 7.3;
  row.tre_mm = 0.41;
  row.similarity = 1.234;
  row.errors = {0.1, 0.2, 0.3, 0.4, 0.5};
  row.evaluations = 437;
  row.drr_count = 874;
  row.stop_reason = "step-below-final";
  return row;
}

/// If results were sent to rank 0, one message would carry those of this many items.
constexpr int kMostCollectedPerBlock = 64;

/// Rank 0's side of one request; seconds from seeing it to having answered it.
double answer_seconds(MPI_Comm handle, std::vector<std::byte>& buffer) {
  int arrived = 0;
  MPI_Status status;
  while (arrived == 0) MPI_Iprobe(MPI_ANY_SOURCE, kRequestTag, handle, &arrived, &status);
  return seconds_of([&] {
    int size = 0;
    MPI_Get_count(&status, MPI_BYTE, &size);
    buffer.resize(static_cast<std::size_t>(size));
    MPI_Recv(
        buffer.data(), size, MPI_BYTE, status.MPI_SOURCE, kRequestTag, handle, MPI_STATUS_IGNORE);
    const std::array<std::int64_t, 2> grant{};
    MPI_Send(grant.data(), 2, MPI_INT64_T, status.MPI_SOURCE, kGrantTag, handle);
  });
}

void ask(MPI_Comm handle, const std::vector<std::byte>& request) {
  MPI_Send(request.data(), static_cast<int>(request.size()), MPI_BYTE, 0, kRequestTag, handle);
  std::array<std::int64_t, 2> grant{};
  MPI_Recv(grant.data(), 2, MPI_INT64_T, 0, kGrantTag, handle, MPI_STATUS_IGNORE);
}

/// Median over requests of `bytes` bytes; on rank 0.
double median_answer_seconds(const Communicator& world, std::size_t bytes, int repetitions) {
  const MPI_Comm handle = mpi_handle(world);
  std::vector<std::byte> buffer(bytes);
  std::vector<double> seconds;
  for (int i = 0; i < repetitions; ++i) {
    if (world.is_root()) seconds.push_back(answer_seconds(handle, buffer));
    if (world.rank() == 1) ask(handle, buffer);
  }
  world.barrier();
  return world.is_root() ? median_of(seconds) : 0.0;
}

}  // namespace

void measure_messages(const Communicator& world, int repetitions, QueueCosts& costs) {
  const auto row_bytes = static_cast<std::size_t>(costs.row_bytes);
  const double small = median_answer_seconds(world, sizeof(std::int64_t), repetitions);
  const double large = median_answer_seconds(
      world, sizeof(std::int64_t) + row_bytes * kMostCollectedPerBlock, repetitions);
  costs.request_seconds = small;
  costs.receive_seconds += (large - small) / kMostCollectedPerBlock;
}

void measure_rows(int repetitions, QueueCosts& costs) {
  const test::ScratchFolder folder;
  const ProgressJournal journal({folder.path(), "case", {}});
  ProgressShard on_rank_zero(journal.files(), {0, 0});
  ProgressShard own(journal.files(), {0, 1});
  // Medians over rounds, because now and then the disk is slow.
  constexpr int kRows = 500;
  std::vector<RegistrationRow> kept(kRows);
  std::vector<double> receive_seconds;
  std::vector<double> write_seconds;
  for (int round = 0; round * kRows < repetitions; ++round) {
    write_seconds.push_back(seconds_of([&] {
      for (int i = 0; i < kRows; ++i)
        own.append(i, {bytes_of(evaluation::TracedRow{some_row(i), {}})});
    }));
    const auto packed = bytes_of(evaluation::TracedRow{some_row(round), {}});
    receive_seconds.push_back(seconds_of([&] {
      for (RegistrationRow& row : kept) {
        on_rank_zero.append(0, {packed});
        row = value_of<evaluation::TracedRow>(packed, "journal").row;
      }
    }));
    costs.row_bytes = static_cast<double>(packed.size() + 2 * sizeof(std::int64_t));
  }
  costs.receive_seconds = median_of(receive_seconds) / kRows;
  costs.write_seconds = median_of(write_seconds) / kRows;
  costs.kept_row_bytes = sizeof(RegistrationRow);
}

}  // namespace af::benchmark
