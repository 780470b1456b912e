// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace af {

/// The outcome of contained_work().
struct ContainedWork {
  bool is_done = false;     ///< the work returned true, and `bytes` are what it made
  std::vector<char> bytes;  ///< of the requested length when done; otherwise empty
  std::string trouble;      ///< otherwise the reason: "refused it", "ended by signal 6 (Aborted)"
};

/// Runs `work` in a copy of this process, because third-party code may end it by a signal (a failed
/// assertion in a decoder, say). The copy shares only the output bytes with this process. It has
/// one thread, prints nothing, leaves no core dump, and is ended when it takes far more memory or
/// time than that many bytes justify.
/// `work` must neither talk to other processes (by MPI, say) nor wait for other threads. An
/// exception counts as false. What another thread has locked at that moment stays locked in the
/// copy for ever. The copy therefore has a deadline, in seconds since its start (by default five
/// times the processor time it may take). \test ContainedWork.*
ContainedWork contained_work(std::size_t bytes,
                             const std::function<bool(std::span<char>)>& work,
                             std::optional<unsigned> deadline_seconds = {});

}  // namespace af
