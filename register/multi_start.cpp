// SPDX-License-Identifier: Apache-2.0
#include "register/multi_start.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <numeric>
#include <optional>
#include <type_traits>

#include "base/error.h"

namespace af::registration {
namespace {

/// A record without its trace as plain numbers.
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
  int view_count;
  bool has_correction;
  CorrectionReport correction;
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
          static_cast<int>(result.stop_reason),
          static_cast<int>(record.view_values.size()),
          result.correction.has_value(),
          result.correction.value_or(CorrectionReport())};
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
  if (from.has_correction) result.correction = from.correction;
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

template <typename T>
void append_bytes(std::span<const T> values, std::vector<std::byte>& bytes) {
  const auto more = std::as_bytes(values);
  bytes.insert(bytes.end(), more.begin(), more.end());
}

/// As it is kept: the record, its views' values, then its trace.
std::vector<std::byte> bytes_of(const RegistrationRecord& record) {
  const PlainRecord head = plain(record);
  std::vector<std::byte> bytes;
  append_bytes(std::span(&head, 1), bytes);
  append_bytes(std::span(record.view_values), bytes);
  append_bytes(std::span<const PlainTraceRow>(plain(record.result.trace)), bytes);
  return bytes;
}

/// Takes a value from the front of `bytes`.
template <typename T>
T take(std::span<const std::byte>& bytes) {
  T value{};
  if (bytes.size() < sizeof(value))
    throw FileError("unfinished registrations",
                    "a record does not have the right size: start over with --restart");
  std::memcpy(&value, bytes.data(), sizeof(value));
  bytes = bytes.subspan(sizeof(value));
  return value;
}

RegistrationRecord record_of(std::span<const std::byte> bytes) {
  const auto head = take<PlainRecord>(bytes);
  RegistrationRecord record = record_of(head);
  for (int i = 0; i < head.view_count; ++i) record.view_values.push_back(take<ViewValue>(bytes));
  while (!bytes.empty()) record.result.trace.push_back(trace_row_of(take<PlainTraceRow>(bytes)));
  return record;
}

/// Rank 0: the records of all starts; the best keeps its trace.
std::vector<RegistrationRecord> records_of(const ResumableItems& items, std::size_t count) {
  std::vector<RegistrationRecord> records(count);
  std::optional<RegistrationRecord> best;
  items.visit([&](std::int64_t index, std::span<const std::byte> bytes) {
    RegistrationRecord record = record_of(bytes);
    record.start_index = index;
    if (!best.has_value() || is_better(record, *best)) best = record;
    record.result.trace.clear();
    records[static_cast<std::size_t>(index)] = std::move(record);
  });
  if (best.has_value()) records[best_record(records)].result.trace = best->result.trace;
  return records;
}

}  // namespace

std::vector<RegistrationRecord> register_starts(RegistrationRunner& runner,
                                                PoseExaminer& examiner,
                                                std::span<const RigidTransform> starts,
                                                const UnfinishedWork& unfinished,
                                                const Communicator& communicator) {
  const auto run = [&](std::int64_t index) {
    RegistrationRecord record;
    record.start_index = index;
    record.result = runner.run(starts[static_cast<std::size_t>(index)], index);
    record.view_values = examiner.view_values(record.result.room_from_ct);
    return record;
  };
  std::vector<RegistrationRecord> records;
  if (starts.empty()) return records;
  if (starts.size() == 1) {
    all_or_none(communicator, [&] {
      if (communicator.is_root()) records.push_back(run(0));
    });
    return records;
  }
  ResumableItems items(unfinished, communicator);
  std::vector<std::int64_t> all(starts.size());
  std::iota(all.begin(), all.end(), 0);
  items.complete(all, "registrations", [&](std::int64_t index) { return bytes_of(run(index)); });
  all_or_none(communicator, [&] {
    if (communicator.is_root()) records = records_of(items, starts.size());
  });
  return records;
}

}  // namespace af::registration
