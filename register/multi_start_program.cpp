// SPDX-License-Identifier: Apache-2.0
#include "register/multi_start_program.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <type_traits>

#include "parallel/work_queue.h"

namespace af::registration {
namespace {

/// A record without its trace as plain numbers, to be sent between ranks.
struct PlainRecord {
  std::int64_t start_index;
  std::array<double, 16> start_room_from_ct;
  std::array<double, 16> room_from_ct;
  double similarity;
  double seconds;
  std::int64_t drr_count;
  std::int64_t rays_outside;
  int evaluations;
  int inadmissible;
  int stop_reason;
};
static_assert(std::is_trivially_copyable_v<PlainRecord>);

struct PlainTraceRow {
  std::array<double, 6> parameters;  ///< rad, mm
  double step_mm;
  double similarity;
  int pass;
  int evaluations;
};
static_assert(std::is_trivially_copyable_v<PlainTraceRow>);

std::array<double, 16> plain(const RigidTransform& transform) {
  std::array<double, 16> values{};
  Eigen::Map<Eigen::Matrix4d>(values.data()) = transform.matrix();
  return values;
}

RigidTransform transform_of(const std::array<double, 16>& values) {
  return RigidTransform(Eigen::Map<const Eigen::Matrix4d>(values.data()));
}

PlainRecord plain(const RegistrationRecord& record) {
  const RegistrationResult& result = record.result;
  return {record.start_index,
          plain(result.start_room_from_ct),
          plain(result.room_from_ct),
          result.similarity,
          result.seconds,
          result.drr_count,
          result.rays_outside,
          result.evaluations,
          result.inadmissible,
          static_cast<int>(result.stop_reason)};
}

RegistrationRecord record_of(const PlainRecord& from) {
  RegistrationRecord record;
  record.start_index = from.start_index;
  RegistrationResult& result = record.result;
  result.start_room_from_ct = transform_of(from.start_room_from_ct);
  result.room_from_ct = transform_of(from.room_from_ct);
  result.similarity = from.similarity;
  result.seconds = from.seconds;
  result.drr_count = from.drr_count;
  result.rays_outside = from.rays_outside;
  result.evaluations = from.evaluations;
  result.inadmissible = from.inadmissible;
  result.stop_reason = static_cast<StopReason>(from.stop_reason);
  return record;
}

std::vector<PlainTraceRow> plain(const std::vector<TraceRow>& trace) {
  std::vector<PlainTraceRow> rows;
  for (const TraceRow& row : trace) {
    PlainTraceRow plain_row{{}, row.step_mm, row.similarity, row.pass, row.evaluations};
    Eigen::Map<Eigen::Vector3d>(plain_row.parameters.data()) = row.parameters.rotation_rad;
    Eigen::Map<Eigen::Vector3d>(plain_row.parameters.data() + 3) = row.parameters.translation_mm;
    rows.push_back(plain_row);
  }
  return rows;
}

TraceRow trace_row_of(const PlainTraceRow& from) {
  TraceRow row;
  row.pass = from.pass;
  row.step_mm = from.step_mm;
  row.evaluations = from.evaluations;
  row.similarity = from.similarity;
  row.parameters.rotation_rad = Eigen::Map<const Eigen::Vector3d>(from.parameters.data());
  row.parameters.translation_mm = Eigen::Map<const Eigen::Vector3d>(from.parameters.data() + 3);
  return row;
}

/// Collective. All ranks' values on rank 0, in rank order.
template <typename T>
std::vector<T> gather_values(const Communicator& communicator, const std::vector<T>& mine) {
  std::vector<T> all;
  for (const std::vector<std::byte>& bytes : communicator.gather(std::as_bytes(std::span(mine)))) {
    const std::size_t first = all.size();
    all.resize(first + bytes.size() / sizeof(T));
    if (!bytes.empty()) std::memcpy(all.data() + first, bytes.data(), bytes.size());
  }
  return all;
}

/// Collective. Moves the best record's trace from the rank that has it to rank 0.
void collect_best_trace(const Communicator& communicator,
                        const RegistrationRecord& my_best,
                        bool has_best,
                        std::vector<RegistrationRecord>& records) {
  std::array<std::uint64_t, 1> best_index{0};
  if (communicator.is_root())
    best_index[0] = static_cast<std::uint64_t>(records[best_record(records)].start_index);
  communicator.maximum(best_index);
  const bool is_mine = has_best && static_cast<std::uint64_t>(my_best.start_index) == best_index[0];
  const std::vector<PlainTraceRow> rows = gather_values(
      communicator, is_mine ? plain(my_best.result.trace) : std::vector<PlainTraceRow>());
  if (!communicator.is_root()) return;
  for (const PlainTraceRow& row : rows)
    records[best_index[0]].result.trace.push_back(trace_row_of(row));
}

}  // namespace

std::vector<RegistrationRecord> register_starts(
    RegistrationRunner& runner,
    std::span<const RigidTransform> starts,
    const Communicator& communicator,
    const std::function<void(std::int64_t done)>& on_progress) {
  if (starts.empty()) return {};
  std::vector<PlainRecord> mine;
  RegistrationRecord my_best;
  bool has_best = false;
  const auto work = [&](std::int64_t index) {
    RegistrationRecord record;
    record.start_index = index;
    record.result = runner.run(starts[static_cast<std::size_t>(index)], index);
    mine.push_back(plain(record));
    if (has_best && !is_better(record, my_best)) return;
    my_best = std::move(record);
    has_best = true;
  };
  for_each_item(communicator, static_cast<std::int64_t>(starts.size()), work, on_progress);

  std::vector<RegistrationRecord> records;
  for (const PlainRecord& from : gather_values(communicator, mine))
    records.push_back(record_of(from));
  std::sort(records.begin(), records.end(), [](const auto& a, const auto& b) {
    return a.start_index < b.start_index;
  });
  collect_best_trace(communicator, my_best, has_best, records);
  return records;
}

}  // namespace af::registration
