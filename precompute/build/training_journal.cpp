// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/training_journal.h"

#include <span>
#include <utility>

#include "base/error.h"
#include "base/stored_bytes.h"
#include "ranks/root_only.h"

namespace af {

namespace {

constexpr const char* kName = "training";

UnfinishedWork giving_way(UnfinishedWork work) {
  work.gives_way = true;
  return work;
}

}  // namespace

std::optional<TrainedCodebook> training_of(std::span<const std::byte> bytes) {
  if (bytes.empty()) return std::nullopt;
  try {
    auto training = value_of<TrainedCodebook>(bytes, kName);
    if (problems(training.codebook).empty()) return training;
  } catch (const FileError&) {
    // A record that holds no training is skipped, and the training starts over.
  }
  return std::nullopt;
}

TrainingJournal::TrainingJournal(UnfinishedWork work,
                                 const CodebookOptions& options,
                                 const Communicator& communicator)
    : communicator_(communicator), store_(giving_way(std::move(work)), communicator) {
  const auto read_last = [&] {
    std::vector<std::byte> last;
    store_.visit([&](std::int64_t, std::span<const std::byte> training) {
      last.assign(training.begin(), training.end());
    });
    return last;
  };
  begun_ = training_of(*on_root(communicator_, read_last).share());
  if (begun_ && (begun_->codebook.size() != static_cast<std::size_t>(options.codewords) ||
                 begun_->codebook.mean_step != options.mean_step))
    begun_.reset();
}

void TrainingJournal::append(const TrainedCodebook& so_far) {
  do_on_root(communicator_, [&] {
    store_.shard().append(static_cast<std::int64_t>(so_far.iterations.size()), {bytes_of(so_far)});
    store_.shard().sync();
  });
}

}  // namespace af
