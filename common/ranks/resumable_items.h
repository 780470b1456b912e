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

/// Shares items over the ranks. Every rank appends what it finishes to a shard of its own in one
/// journal, and no result passes through rank 0 until all are there. The result of an item must
/// depend neither on the rank that makes it, nor on anything that `decides` does not name.
/// \test ResumableItems.DoesOnlyWhatNoEarlierRunFinished
class ResumableItems {
 public:
  using Work = std::function<std::vector<std::byte>(std::int64_t item)>;
  using Receive = ProgressJournal::Visit;

  /// Collective. Opens or creates the journal. Throws InputError that names the difference when an
  /// earlier run began it with other options or inputs.
  ResumableItems(const UnfinishedWork& work, const Communicator& communicator);

  /// Collective. Does those of `items` that no run has finished (ascending, each at least 0, the
  /// same on every rank). Ranks get items as they become free; `work` must not call MPI. Rank 0
  /// reports the progress of `what` ("case skull, field registrations"; empty: no report). When any
  /// rank was asked to stop, the remaining items are skipped and every rank throws StoppedError,
  /// with everything finished saved.
  void complete(const std::vector<std::int64_t>& items, const std::string& what, const Work& work);

  /// Rank 0, after complete(): calls `receive` with the result of each of its items, in any order.
  /// When several runs made the same item, it is called with each of the results, which are equal.
  /// Throws FileError when some are missing.
  void visit(const Receive& receive) const;

 private:
  /// Collective. Those of `items` that no earlier run finished.
  [[nodiscard]] std::vector<std::int64_t> unfinished(const std::vector<std::int64_t>& items) const;
  /// Collective. Makes the appended items survive a crash of the machine. Throws StoppedError when
  /// a stop was asked for.
  void save(const std::string& what);

  Communicator communicator_;
  ProgressStore store_;                 ///< keys are items
  std::vector<std::int64_t> finished_;  ///< rank 0: items that earlier runs finished, ascending
  std::vector<std::int64_t> items_;     ///< rank 0: those of complete()
  std::uint64_t saved_ =
      0;  ///< how many of items_ this rank saved; on rank 0 earlier runs count too
};

}  // namespace af
