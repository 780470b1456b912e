// SPDX-License-Identifier: Apache-2.0
#include "ranks/mpi_group.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace af {

namespace {

/// MPI counts are int, so longer messages go in pieces.
constexpr std::size_t kLargestPiece = std::size_t{1} << 30;
constexpr int kRequestTag = 11;
constexpr int kGrantTag = 12;

void require_success(int code, const char* call) {
  if (code == MPI_SUCCESS) return;
  throw std::runtime_error(std::string(call) + " failed with MPI error " + std::to_string(code));
}

}  // namespace

MpiGroup::MpiGroup(MPI_Comm handle) : handle_(handle) {
  MPI_Comm_rank(handle_, &rank_);
  MPI_Comm_size(handle_, &size_);
}

void MpiGroup::barrier() {
  require_success(MPI_Barrier(handle_), "MPI_Barrier");
}

void MpiGroup::reduce(std::span<std::uint64_t> values, Reduction reduction) {
  const MPI_Op operation = reduction == Reduction::Sum ? MPI_SUM : MPI_MAX;
  constexpr std::size_t kPiece = kLargestPiece / sizeof(std::uint64_t);
  for (std::size_t first = 0; first < values.size(); first += kPiece) {
    const std::size_t count = std::min(kPiece, values.size() - first);
    void* buffer = values.data() + first;
    require_success(
        MPI_Allreduce(
            MPI_IN_PLACE, buffer, static_cast<int>(count), MPI_UINT64_T, operation, handle_),
        "MPI_Allreduce");
  }
}

void MpiGroup::broadcast(std::span<std::byte> bytes) {
  for (std::size_t first = 0; first < bytes.size(); first += kLargestPiece) {
    const std::size_t count = std::min(kLargestPiece, bytes.size() - first);
    require_success(MPI_Bcast(bytes.data() + first, static_cast<int>(count), MPI_BYTE, 0, handle_),
                    "MPI_Bcast");
  }
}

std::vector<std::vector<std::byte>> MpiGroup::all_gather(std::span<const std::byte> mine) {
  const auto ranks = static_cast<std::size_t>(size_);
  const std::uint64_t my_bytes = mine.size();
  std::vector<std::uint64_t> bytes(ranks);
  // The check compares names of types, and data() has lost the name of uint64_t.
  require_success(  // NOLINTNEXTLINE(mpi-type-mismatch)
      MPI_Allgather(&my_bytes, 1, MPI_UINT64_T, bytes.data(), 1, MPI_UINT64_T, handle_),
      "MPI_Allgather");
  std::vector<std::vector<std::byte>> parts(ranks);
  const std::size_t piece = kLargestPiece / ranks;
  for (std::size_t first = 0; first < *std::ranges::max_element(bytes); first += piece) {
    std::vector<int> counts, offsets;
    int total = 0;
    for (const std::uint64_t of_rank : bytes) {
      offsets.push_back(total);
      counts.push_back(static_cast<int>(std::min(piece, of_rank - std::min(of_rank, first))));
      total += counts.back();
    }
    std::vector<std::byte> all(static_cast<std::size_t>(total));
    require_success(MPI_Allgatherv(mine.data() + std::min(mine.size(), first),
                                   counts[static_cast<std::size_t>(rank_)],
                                   MPI_BYTE,
                                   all.data(),
                                   counts.data(),
                                   offsets.data(),
                                   MPI_BYTE,
                                   handle_),
                    "MPI_Allgatherv");
    for (std::size_t i = 0; i < ranks; ++i)
      parts[i].insert(
          parts[i].end(), all.begin() + offsets[i], all.begin() + offsets[i] + counts[i]);
  }
  return parts;
}

std::shared_ptr<RankGroup> MpiGroup::node() {
  if (node_ == nullptr) {
    MPI_Comm node = MPI_COMM_NULL;
    require_success(MPI_Comm_split_type(handle_, MPI_COMM_TYPE_SHARED, rank_, MPI_INFO_NULL, &node),
                    "MPI_Comm_split_type");
    node_ = std::make_shared<MpiGroup>(node);
  }
  return node_;
}

void MpiGroup::broadcast_to_nodes(std::span<std::byte> bytes) {
  const bool is_first_of_node = node()->rank() == 0;
  MPI_Comm first_ranks = MPI_COMM_NULL;
  require_success(
      MPI_Comm_split(handle_, is_first_of_node ? 0 : MPI_UNDEFINED, rank_, &first_ranks),
      "MPI_Comm_split");
  if (!is_first_of_node) return;
  MpiGroup(first_ranks).broadcast(bytes);
  MPI_Comm_free(&first_ranks);  // all of its ranks are here
}

// Messages instead of one-sided windows, which fail across hosts over TCP, or stall while the
// target computes.
bool MpiGroup::answer_request(const std::function<Grant(const Request&)>& answer) {
  int arrived = 0;
  MPI_Status status;
  MPI_Iprobe(MPI_ANY_SOURCE, kRequestTag, handle_, &arrived, &status);
  if (arrived == 0) return false;
  Request request;
  MPI_Recv(&request, 2, MPI_INT64_T, status.MPI_SOURCE, kRequestTag, handle_, MPI_STATUS_IGNORE);
  const Grant grant = answer(request);
  MPI_Send(&grant, 2, MPI_INT64_T, status.MPI_SOURCE, kGrantTag, handle_);
  return true;
}

RankGroup::Grant MpiGroup::ask(const Request& request) {
  MPI_Send(&request, 2, MPI_INT64_T, 0, kRequestTag, handle_);
  Grant grant;
  MPI_Recv(&grant, 2, MPI_INT64_T, 0, kGrantTag, handle_, MPI_STATUS_IGNORE);
  return grant;
}

void MpiGroup::abort(int exit_code) {
  MPI_Abort(MPI_COMM_WORLD, exit_code);
  std::_Exit(exit_code);
}

MPI_Comm mpi_handle(const Communicator& communicator) {
  const auto* const ranks = dynamic_cast<const MpiGroup*>(communicator.group());
  return ranks == nullptr ? MPI_COMM_NULL : ranks->handle();
}

}  // namespace af
