// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "base/shared_array.h"

namespace af {

class RankGroup;

/// The ranks that share a job's work: those of MPI (MpiEnvironment), or the processes of one
/// machine (ProcessGroup), or one. How they speak to each other stays behind this header.
class Communicator {
 public:
  /// All ranks of the job: this process alone where neither of the two lives.
  static Communicator world();
  /// The calling process alone, whatever the job. \test CommunicatorAlone.NeedsNoMpi
  static Communicator alone();

  [[nodiscard]] int rank() const { return rank_; }
  [[nodiscard]] int size() const { return size_; }
  [[nodiscard]] bool is_root() const { return rank() == 0; }

  /// Collective.
  void barrier() const;
  /// Collective. Exact element-wise sums, in place.
  void sum(std::span<std::uint64_t> values) const;
  /// Collective. Element-wise maxima, in place.
  void maximum(std::span<std::uint64_t> values) const;
  /// Collective. Copies `bytes` of rank 0 to every rank. Any size: it is sent in pieces below 2
  /// GiB.
  void broadcast(std::vector<std::byte>& bytes) const;
  void broadcast(std::string& text) const;
  /// Collective. Every rank's bytes, in rank order, on every rank.
  [[nodiscard]] std::vector<std::vector<std::byte>> all_gather(
      std::span<const std::byte> mine) const;
  /// A cache line.
  static constexpr std::size_t kNodeMemoryAlignment = 64;

  /// Collective. The ranks that share this rank's memory, a group that lasts as long as the job's
  /// does.
  [[nodiscard]] Communicator node() const;

  /// Collective. Memory of `bytes` zeros held once per node, aligned to kNodeMemoryAlignment.
  /// Letting go of it is not collective: each process unmaps its own view (NodeMemoryFile), and the
  /// system frees the memory with the last. Ranks may therefore do it in any order, even while an
  /// exception unwinds, and none waits.
  [[nodiscard]] std::shared_ptr<std::byte> allocate_on_node(std::size_t bytes) const;
  /// Collective. The same, filled: `fill` runs only on each node's first rank, and all wait for it.
  /// An exception in `fill` is thrown on every rank of every node.
  [[nodiscard]] std::shared_ptr<const std::byte> allocate_on_node(
      std::size_t bytes, const std::function<void(std::span<std::byte>)>& fill) const;
  /// Collective. The same, filled together: `fill` runs on every rank of the node and gets the
  /// whole memory, its own number and the number of ranks.
  [[nodiscard]] std::shared_ptr<const std::byte> allocate_on_node_together(
      std::size_t bytes,
      const std::function<void(std::span<std::byte>, int part, int parts)>& fill) const;

  /// Collective. The same, filled on rank 0 alone. The other nodes get a copy, so that no file need
  /// be read twice. An exception in `fill` is thrown on every rank.
  [[nodiscard]] std::shared_ptr<const std::byte> allocate_on_nodes_from_root(
      std::size_t bytes, const std::function<void(std::span<std::byte>)>& fill) const;
  /// Collective. The same, filled by the ranks of rank 0's node together, as in
  /// allocate_on_node_together().
  [[nodiscard]] std::shared_ptr<const std::byte> allocate_on_nodes_from_root_together(
      std::size_t bytes,
      const std::function<void(std::span<std::byte>, int part, int parts)>& fill) const;

  /// Null for Communicator::alone().
  [[nodiscard]] RankGroup* group() const { return group_.get(); }

 private:
  explicit Communicator(std::shared_ptr<RankGroup> group);

  std::shared_ptr<RankGroup> group_;
  int rank_ = 0;
  int size_ = 1;
};

/// What went wrong on some rank, for all_or_none().
struct RankFailure {
  int exit_code = 0;  ///< 0: none
  std::string message;
};

/// Collective. The failure of the lowest failed rank, the same on every rank. Its message names
/// that rank.
RankFailure first_failure(const Communicator& communicator, const RankFailure& mine);

/// The failure that an exception means, as app_main reports it.
RankFailure failure_of(const std::exception_ptr& error);

/// Throws the failure as a RemoteError with its exit code.
[[noreturn]] void throw_failure(const RankFailure& failure);

/// Collective. Runs `function` on every rank. When it throws on any rank, every rank throws the
/// same error. Wrap everything that each rank does by itself before the next collective call and
/// that may fail on only some ranks; otherwise the other ranks wait for ever. For what rank 0 does
/// for all, use on_root() or do_on_root().
template <typename Function>
std::invoke_result_t<Function> all_or_none(const Communicator& communicator, Function&& function) {
  using Result = std::invoke_result_t<Function>;
  RankFailure mine;
  if constexpr (std::is_void_v<Result>) {
    try {
      function();
    } catch (...) {
      mine = failure_of(std::current_exception());
    }
    if (const RankFailure failure = first_failure(communicator, mine); failure.exit_code != 0)
      throw_failure(failure);
  } else {
    std::optional<Result> result;
    try {
      result.emplace(function());
    } catch (...) {
      mine = failure_of(std::current_exception());
    }
    if (const RankFailure failure = first_failure(communicator, mine); failure.exit_code != 0)
      throw_failure(failure);
    return std::move(*result);
  }
}

}  // namespace af
