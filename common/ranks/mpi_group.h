// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mpi.h>

#include "ranks/communicator.h"
#include "ranks/rank_group.h"

namespace af {

/// Ranks of MPI. Its destructor frees no group, which is a collective call; MPI_Finalize() does.
class MpiGroup : public RankGroup {
 public:
  explicit MpiGroup(MPI_Comm handle);

  void barrier() override;
  void reduce(std::span<std::uint64_t> values, Reduction reduction) override;
  void broadcast(std::span<std::byte> bytes) override;
  std::vector<std::vector<std::byte>> all_gather(std::span<const std::byte> mine) override;
  std::shared_ptr<RankGroup> node() override;
  void broadcast_to_nodes(std::span<std::byte> bytes) override;
  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return size_; }
  bool answer_request(const std::function<Grant(const Request&)>& answer) override;
  Grant ask(const Request& request) override;
  [[noreturn]] void abort(int exit_code) override;

  [[nodiscard]] MPI_Comm handle() const { return handle_; }

 private:
  MPI_Comm handle_;
  int rank_ = 0;
  int size_ = 1;
  std::shared_ptr<RankGroup> node_;  ///< once someone has asked for it
};

/// MPI_COMM_NULL where these are no ranks of MPI.
MPI_Comm mpi_handle(const Communicator& communicator);

}  // namespace af
