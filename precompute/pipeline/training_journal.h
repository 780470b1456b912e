// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "parallel/communicator.h"
#include "precompute/codebook/codebook_training.h"
#include "run/progress_store.h"

namespace af {

/// The iterations of an unfinished training, in a journal that rank 0 keeps in the progress folder.
class TrainingJournal {
 public:
  /// Collective. Opens or creates the journal. Iterations with other options are thrown away: the
  /// codebook may be changed between a stop and going on, the cast units stay. So are those whose
  /// codebook is not usable, or not of the options' size and step of means.
  TrainingJournal(UnfinishedWork work,
                  const CodebookOptions& options,
                  const Communicator& communicator);

  /// What the last sound iteration of earlier runs gave, the same on every rank; none without one.
  [[nodiscard]] const std::optional<TrainedCodebook>& begun() const { return begun_; }

  /// Collective. Keeps the training after an iteration.
  void append(const TrainedCodebook& so_far);

 private:
  Communicator communicator_;
  ProgressStore store_;  ///< keys are counts of iterations
  std::optional<TrainedCodebook> begun_;
};

/// The training of bytes_of(); nothing when they are not of one with a usable codebook.
std::optional<TrainedCodebook> training_of(std::span<const std::byte> bytes);

}  // namespace af
