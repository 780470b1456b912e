// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "precompute/codebook/codebook_training.h"
#include "ranks/communicator.h"
#include "ranks/progress_store.h"

namespace af {

/// The iterations of an unfinished training, in a journal that rank 0 keeps in the progress folder.
class TrainingJournal {
 public:
  /// Collective. Opens or creates the journal. Discards iterations made with other options, because
  /// a resumed run may change the codebook and keep the cast units. Also discards those whose
  /// codebook is unusable or has another size or mean step than the options.
  TrainingJournal(UnfinishedWork work,
                  const CodebookOptions& options,
                  const Communicator& communicator);

  /// Result of the last valid iteration of earlier runs, the same on every rank. None if there is
  /// none.
  [[nodiscard]] const std::optional<TrainedCodebook>& begun() const { return begun_; }

  /// Collective. Keeps the training after an iteration.
  void append(const TrainedCodebook& so_far);

 private:
  Communicator communicator_;
  ProgressStore store_;  ///< keys are counts of iterations
  std::optional<TrainedCodebook> begun_;
};

/// Restores a training from bytes_of(). Nothing when it has no usable codebook.
std::optional<TrainedCodebook> training_of(std::span<const std::byte> bytes);

}  // namespace af
