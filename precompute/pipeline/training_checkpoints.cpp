// SPDX-License-Identifier: Apache-2.0
#include "precompute/pipeline/training_checkpoints.h"

#include <span>

#include "base/error.h"
#include "base/stored_bytes.h"

namespace af {

namespace {

constexpr const char* kName = "training";

/// Of other options: thrown away. Other faults are the caller's.
ProgressJournal opened(const std::filesystem::path& folder, const DecidingValues& decides) {
  try {
    return {folder, kName, decides, false};
  } catch (const InputError&) {
    return {folder, kName, decides, true};
  }
}

}  // namespace

std::optional<TrainedCodebook> training_of(std::span<const std::byte> bytes) {
  if (bytes.empty()) return std::nullopt;
  try {
    auto training = value_of<TrainedCodebook>(bytes, kName);
    if (problems(training.codebook).empty()) return training;
  } catch (const FileError&) {
    // A record that is none is as good as none: the training begins anew.
  }
  return std::nullopt;
}

TrainingJournal::TrainingJournal(const std::filesystem::path& progress_folder,
                                 const DecidingValues& decides,
                                 std::size_t codewords,
                                 const Communicator& communicator)
    : communicator_(communicator) {
  std::vector<std::byte> last;
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    ProgressJournal journal = opened(progress_folder, decides);
    journal.mend_and_visit(
        [&](std::span<const std::byte> record) { last.assign(record.begin(), record.end()); });
    shard_.emplace(progress_folder, kName, journal.run(), 0);
  });
  communicator_.broadcast(last);
  begun_ = training_of(last);
  if (begun_ && begun_->codebook.size() != codewords) begun_.reset();
}

void TrainingJournal::append(const TrainedCodebook& so_far) {
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    shard_->append(bytes_of(so_far));
    shard_->sync();
  });
}

}  // namespace af
