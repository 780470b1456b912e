// SPDX-License-Identifier: Apache-2.0
#include "register/multi_start.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <optional>

#include "base/stored_bytes.h"

namespace af::registration {
namespace {

/// Rank 0: the records of all starts; the best keeps its trace.
std::vector<RegistrationRecord> records_of(const ResumableItems& items, std::size_t count) {
  std::vector<RegistrationRecord> records(count);
  std::optional<RegistrationRecord> best;
  items.visit([&](std::int64_t index, std::span<const std::byte> bytes) {
    auto record = value_of<RegistrationRecord>(bytes, "unfinished registrations");
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
                                                UncertaintyEstimator& estimator,
                                                std::span<const RigidTransform> starts,
                                                const UnfinishedWork& unfinished,
                                                const Communicator& communicator) {
  const auto run = [&](std::int64_t index) {
    RegistrationRecord record;
    record.start_index = index;
    record.result = runner.run(starts[static_cast<std::size_t>(index)], index);
    record.view_values = examiner.view_values(record.result.room_from_ct);
    record.uncertainty = estimator.report(record.result, record.view_values);
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
