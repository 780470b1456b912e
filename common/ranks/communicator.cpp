// SPDX-License-Identifier: Apache-2.0
#include "ranks/communicator.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <sys/mman.h>

#include "base/error.h"
#include "base/host_name.h"
#include "ranks/mpi_handle.h"
#include "ranks/node_memory_file.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

/// MPI counts are int, so longer messages go in pieces.
constexpr std::size_t kLargestPiece = std::size_t{1} << 30;

/// Whether this is Communicator::alone(): there is nobody to talk to, and MPI may not be
/// initialised.
bool is_alone(MPI_Comm communicator) {
  return communicator == MPI_COMM_NULL;
}

void require_success(int code, const char* call) {
  if (code == MPI_SUCCESS) return;
  throw std::runtime_error(std::string(call) + " failed with MPI error " + std::to_string(code));
}

void reduce_in_place(MPI_Comm communicator, std::span<std::uint64_t> values, MPI_Op operation) {
  constexpr std::size_t kPiece = kLargestPiece / sizeof(std::uint64_t);
  for (std::size_t first = 0; first < values.size(); first += kPiece) {
    const std::size_t count = std::min(kPiece, values.size() - first);
    void* buffer = values.data() + first;
    require_success(
        MPI_Allreduce(
            MPI_IN_PLACE, buffer, static_cast<int>(count), MPI_UINT64_T, operation, communicator),
        "MPI_Allreduce");
  }
}

void broadcast_bytes(MPI_Comm communicator, std::span<std::byte> bytes) {
  for (std::size_t first = 0; first < bytes.size(); first += kLargestPiece) {
    const std::size_t count = std::min(kLargestPiece, bytes.size() - first);
    require_success(
        MPI_Bcast(bytes.data() + first, static_cast<int>(count), MPI_BYTE, 0, communicator),
        "MPI_Bcast");
  }
}

std::uint64_t broadcast_size(MPI_Comm communicator, std::uint64_t size) {
  require_success(MPI_Bcast(&size, 1, MPI_UINT64_T, 0, communicator), "MPI_Bcast");
  return size;
}

std::vector<std::byte> bytes_of(const RankFailure& failure) {
  std::vector<std::byte> bytes(sizeof(int) + failure.message.size());
  std::memcpy(bytes.data(), &failure.exit_code, sizeof(int));
  std::memcpy(bytes.data() + sizeof(int), failure.message.data(), failure.message.size());
  return bytes;
}

RankFailure failure_from(std::span<const std::byte> bytes) {
  RankFailure failure;
  std::memcpy(&failure.exit_code, bytes.data(), sizeof(int));
  failure.message.assign(reinterpret_cast<const char*>(bytes.data()) + sizeof(int),
                         bytes.size() - sizeof(int));
  return failure;
}

/// Collective. Where each rank runs.
std::vector<std::string> host_names(const Communicator& communicator) {
  std::vector<std::string> names;
  const std::string mine = host_name();
  for (const auto& bytes : communicator.all_gather(std::as_bytes(std::span(mine))))
    names.emplace_back(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return names;
}

RankFailure plain_failure_of(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const Error& known) {
    return {static_cast<int>(known.exit_code()), known.what()};
  } catch (const std::bad_alloc&) {
    return {static_cast<int>(ExitCode::Internal), "out of memory"};
  } catch (const std::filesystem::filesystem_error& error_of_file) {
    // The path is at fault: the name is too long, links form a circle, or a folder may not be
    // listed.
    return {static_cast<int>(ExitCode::File),
            error_of_file.path1().string() + ": " + error_of_file.code().message()};
  } catch (const std::exception& unknown) {
    return {static_cast<int>(ExitCode::Internal), std::string("internal error: ") + unknown.what()};
  } catch (...) {
    return {static_cast<int>(ExitCode::Internal), "internal error"};
  }
}

/// Zeros. Pages are allocated as they are touched.
std::shared_ptr<std::byte> memory_of_process(std::size_t bytes) {
  const std::size_t mapped = std::max<std::size_t>(bytes, 1);
  void* const start =
      ::mmap(nullptr, mapped, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (start == MAP_FAILED) throw std::bad_alloc();
  return {static_cast<std::byte*>(start),
          [mapped](std::byte* memory) { ::munmap(memory, mapped); }};
}

/// Collective over `world`; the same memory for all ranks of `node`.
std::shared_ptr<std::byte> memory_of_node(const Communicator& world,
                                          const Communicator& node,
                                          std::size_t bytes) {
  NodeMemoryFile file;
  std::string name;
  all_or_none(world, [&] {
    if (node.size() > 1 && node.is_root()) name = file.create(bytes);
  });
  node.broadcast(name);
  return all_or_none(world, [&] {
    if (node.size() == 1) return memory_of_process(bytes);
    if (!node.is_root()) file.open(name);
    return file.map(bytes);
  });
}

}  // namespace

Communicator Communicator::world() {
  static const auto world = std::make_shared<Impl>(Impl{MPI_COMM_WORLD});
  return Communicator(world);
}

Communicator Communicator::alone() {
  return Communicator(std::make_shared<Impl>());
}

int Communicator::rank() const {
  int rank = 0;
  if (is_alone(impl_->handle)) return rank;
  MPI_Comm_rank(impl_->handle, &rank);
  return rank;
}

int Communicator::size() const {
  int size = 1;
  if (is_alone(impl_->handle)) return size;
  MPI_Comm_size(impl_->handle, &size);
  return size;
}

void Communicator::barrier() const {
  if (is_alone(impl_->handle)) return;
  const WaitNote waits;
  require_success(MPI_Barrier(impl_->handle), "MPI_Barrier");
}

void Communicator::sum(std::span<std::uint64_t> values) const {
  if (is_alone(impl_->handle)) return;
  const WaitNote waits;
  reduce_in_place(impl_->handle, values, MPI_SUM);
}

void Communicator::maximum(std::span<std::uint64_t> values) const {
  if (is_alone(impl_->handle)) return;
  const WaitNote waits;
  reduce_in_place(impl_->handle, values, MPI_MAX);
}

void Communicator::broadcast(std::vector<std::byte>& bytes) const {
  if (is_alone(impl_->handle)) return;
  const WaitNote waits;
  bytes.resize(broadcast_size(impl_->handle, bytes.size()));
  broadcast_bytes(impl_->handle, bytes);
}

void Communicator::broadcast(std::string& text) const {
  if (is_alone(impl_->handle)) return;
  const WaitNote waits;
  text.resize(broadcast_size(impl_->handle, text.size()));
  broadcast_bytes(impl_->handle, std::as_writable_bytes(std::span(text)));
}

std::vector<std::vector<std::byte>> Communicator::all_gather(
    std::span<const std::byte> mine) const {
  if (is_alone(impl_->handle)) return {{mine.begin(), mine.end()}};
  const WaitNote waits;
  const auto ranks = static_cast<std::size_t>(size());
  const std::uint64_t my_bytes = mine.size();
  std::vector<std::uint64_t> bytes(ranks);
  // The check compares names of types, and data() has lost the name of uint64_t.
  require_success(  // NOLINTNEXTLINE(mpi-type-mismatch)
      MPI_Allgather(&my_bytes, 1, MPI_UINT64_T, bytes.data(), 1, MPI_UINT64_T, impl_->handle),
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
                                   counts[static_cast<std::size_t>(rank())],
                                   MPI_BYTE,
                                   all.data(),
                                   counts.data(),
                                   offsets.data(),
                                   MPI_BYTE,
                                   impl_->handle),
                    "MPI_Allgatherv");
    for (std::size_t i = 0; i < ranks; ++i)
      parts[i].insert(
          parts[i].end(), all.begin() + offsets[i], all.begin() + offsets[i] + counts[i]);
  }
  return parts;
}

Communicator Communicator::node() const {
  if (is_alone(impl_->handle)) return *this;
  if (impl_->node == nullptr) {
    const WaitNote waits;
    auto node = std::make_shared<Impl>();
    require_success(MPI_Comm_split_type(
                        impl_->handle, MPI_COMM_TYPE_SHARED, rank(), MPI_INFO_NULL, &node->handle),
                    "MPI_Comm_split_type");
    impl_->node = std::move(node);
  }
  return Communicator(impl_->node);
}

std::shared_ptr<std::byte> Communicator::allocate_on_node(std::size_t bytes) const {
  if (is_alone(impl_->handle)) return memory_of_process(bytes);
  return memory_of_node(*this, node(), bytes);
}

std::shared_ptr<const std::byte> Communicator::allocate_on_node(
    std::size_t bytes, const std::function<void(std::span<std::byte>)>& fill) const {
  return allocate_on_node_together(bytes, [&](std::span<std::byte> memory, int part, int) {
    if (part == 0) fill(memory);
  });
}

std::shared_ptr<const std::byte> Communicator::allocate_on_node_together(
    std::size_t bytes,
    const std::function<void(std::span<std::byte>, int part, int parts)>& fill) const {
  const std::shared_ptr<std::byte> memory = allocate_on_node(bytes);
  if (is_alone(impl_->handle)) {
    fill(std::span<std::byte>(memory.get(), bytes), 0, 1);
    return memory;
  }
  const Communicator on_node = node();
  // All nodes take part. Ranks of another node would otherwise go on to a collective call that
  // these ranks never reach.
  all_or_none(*this, [&] {
    fill(std::span<std::byte>(memory.get(), bytes), on_node.rank(), on_node.size());
  });
  on_node.barrier();
  return memory;
}

std::shared_ptr<const std::byte> Communicator::allocate_on_nodes_from_root(
    std::size_t bytes, const std::function<void(std::span<std::byte>)>& fill) const {
  return allocate_on_nodes_from_root_together(bytes,
                                              [&](std::span<std::byte> memory, int part, int) {
                                                if (part == 0) fill(memory);
                                              });
}

std::shared_ptr<const std::byte> Communicator::allocate_on_nodes_from_root_together(
    std::size_t bytes,
    const std::function<void(std::span<std::byte>, int part, int parts)>& fill) const {
  if (is_alone(impl_->handle)) return allocate_on_node_together(bytes, fill);
  const Communicator on_node = node();
  std::array<std::uint64_t, 1> is_roots_node{is_root() ? std::uint64_t{1} : std::uint64_t{0}};
  on_node.maximum(is_roots_node);
  auto owner = allocate_on_node(bytes);
  const std::span<std::byte> memory(owner.get(), bytes);
  all_or_none(*this, [&] {
    if (is_roots_node[0] != 0) fill(memory, on_node.rank(), on_node.size());
  });
  const bool is_first_of_node = on_node.is_root();
  MPI_Comm first_ranks = MPI_COMM_NULL;
  require_success(
      MPI_Comm_split(impl_->handle, is_first_of_node ? 0 : MPI_UNDEFINED, rank(), &first_ranks),
      "MPI_Comm_split");
  if (is_first_of_node) {
    const WaitNote waits;
    broadcast_bytes(first_ranks, memory);
    MPI_Comm_free(&first_ranks);  // all of its ranks are here
  }
  barrier();
  return owner;
}

RankFailure first_failure(const Communicator& communicator, const RankFailure& mine) {
  // The common case costs one small reduction; texts are sent only when a rank failed.
  std::array<std::uint64_t, 1> any{mine.exit_code != 0 ? std::uint64_t{1} : std::uint64_t{0}};
  communicator.maximum(any);
  if (any[0] == 0) return {};
  const auto parts = communicator.all_gather(bytes_of(mine));
  const std::vector<std::string> hosts = host_names(communicator);
  for (std::size_t rank = 0; rank < parts.size(); ++rank) {
    RankFailure failure = failure_from(parts[rank]);
    if (failure.exit_code == 0) continue;
    // When every rank met the same error, for example a bad option, the message names no rank.
    const bool is_shared = std::all_of(
        parts.begin(), parts.end(), [&](const auto& part) { return part == parts[rank]; });
    if (!is_shared && parts.size() > 1)
      failure.message =
          "rank " + std::to_string(rank) + " on " + hosts[rank] + ": " + failure.message;
    return failure;
  }
  return {};
}

RankFailure failure_of(const std::exception_ptr& error) {
  RankFailure failure = plain_failure_of(error);
  // The unit that a rank was at tells more than its number. A stop is not a failure.
  const std::string unit = take_failed_unit();
  if (!unit.empty() && failure.exit_code != static_cast<int>(ExitCode::Stopped))
    failure.message = unit + ": " + failure.message;
  return failure;
}

void throw_failure(const RankFailure& failure) {
  throw RemoteError(static_cast<ExitCode>(failure.exit_code), failure.message);
}

}  // namespace af
