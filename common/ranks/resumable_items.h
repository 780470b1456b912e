// SPDX-License-Identifier: Apache-2.0
// Numbered items of work shared over ranks. Finished items are kept, so that a stopped or killed
// run can continue.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "ranks/communicator.h"
#include "ranks/progress_store.h"

namespace af {

/// Every rank appends what it finishes to a shard of its own in one journal: no result passes
/// through rank 0 until all are there. The result of an item must not depend on the rank that makes
/// it, nor on anything that `decides` does not name.
/// \test ResumableItems.DoesOnlyWhatNoEarlierRunFinished
class ResumableItems {
 public:
  using Work = std::function<std::vector<std::byte>(std::int64_t item)>;
  using Receive = ProgressJournal::Visit;

  /// Collective. Opens or creates the journal. InputError that names the difference when an earlier
  /// run began it with other options or inputs.
  ResumableItems(const UnfinishedWork& work, const Communicator& communicator);

  /// Collective. Does those of `items` (ascending, each at least 0, the same on every rank) that no
  /// run has finished, shared over the ranks as these become free; `work` must not call MPI. Rank 0
  /// reports the progress of `what` ("case skull, field registrations"; empty: no report). When any
  /// rank was asked to stop, the remaining items are passed over and every rank throws
  /// StoppedError, with everything finished saved.
  void complete(const std::vector<std::int64_t>& items, const std::string& what, const Work& work);

  /// Rank 0, after complete(): calls `receive` with the result of each of its items, in any order.
  /// When several runs made the same item, it is called with each of the results, which are equal.
  /// FileError when some are missing.
  void visit(const Receive& receive) const;

 private:
  /// Collective. Those of `items` that no earlier run finished.
  [[nodiscard]] std::vector<std::int64_t> unfinished(const std::vector<std::int64_t>& items) const;
  /// Collective. Makes the appended items survive a crash of the machine; StoppedError when a stop
  /// was asked for.
  void save(const std::string& what);

  Communicator communicator_;
  ProgressStore store_;                 ///< keys are items
  std::vector<std::int64_t> finished_;  ///< rank 0: by earlier runs, ascending
  std::vector<std::int64_t> items_;     ///< rank 0: of complete()
  std::uint64_t saved_ = 0;             ///< of items_, by this rank; on rank 0 by earlier runs too
};

}  // namespace af
