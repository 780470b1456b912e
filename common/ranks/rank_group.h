// SPDX-License-Identifier: Apache-2.0
// What a Communicator speaks through. Internal to this folder and to what writes by MPI-IO.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace af {

/// Two or more ranks, or one that MPI started. All but the last four functions are collective.
class RankGroup {
 public:
  RankGroup() = default;
  /// Not collective: the last owner on a rank may go at a place where the other ranks never come.
  virtual ~RankGroup() = default;
  RankGroup(const RankGroup&) = delete;
  RankGroup& operator=(const RankGroup&) = delete;

  enum class Reduction { Sum, Maximum };
  /// By which a rank asks rank 0 for work. It says how many items it has finished since the last
  /// one, and whether one failed.
  struct Request {
    std::int64_t finished = 0;
    std::int64_t has_failed = 0;
  };
  /// Items to do; no more when `count` is 0.
  struct Grant {
    std::int64_t first = 0;
    std::int64_t count = 0;
  };

  virtual void barrier() = 0;
  virtual void reduce(std::span<std::uint64_t> values, Reduction reduction) = 0;
  virtual void broadcast(std::span<std::byte> bytes) = 0;
  virtual std::vector<std::vector<std::byte>> all_gather(std::span<const std::byte> mine) = 0;
  /// The ranks that share this rank's memory; null where these are all.
  virtual std::shared_ptr<RankGroup> node() = 0;
  /// Copies `bytes` of rank 0 to the first rank of every other node.
  virtual void broadcast_to_nodes(std::span<std::byte> bytes) = 0;

  [[nodiscard]] virtual int rank() const = 0;
  [[nodiscard]] virtual int size() const = 0;
  /// For rank 0: answers one request, if there is one.
  virtual bool answer_request(const std::function<Grant(const Request&)>& answer) = 0;
  /// For every other rank.
  virtual Grant ask(const Request& request) = 0;
  /// Ends all ranks at once, from any thread.
  [[noreturn]] virtual void abort(int exit_code) = 0;
};

/// The group of Communicator::world(); null while there is none. Set by what starts ranks.
std::shared_ptr<RankGroup>& ranks_of_job();

}  // namespace af
