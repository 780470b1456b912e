// SPDX-License-Identifier: Apache-2.0
#include "parallel/communicator.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <new>
#include <stdexcept>

#include "base/error.h"
#include "parallel/mpi_handle.h"
#include "parallel/work_watch.h"

namespace af {

namespace {

/// MPI counts are int: longer messages go in pieces.
constexpr std::size_t kLargestPiece = std::size_t{1} << 30;

/// Communicator::alone(): there is nobody to talk to, and MPI may not be initialised.
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
    // A name too long, links in a circle, a folder that may not be listed: the path is at fault.
    return {static_cast<int>(ExitCode::File),
            error_of_file.path1().string() + ": " + error_of_file.code().message()};
  } catch (const std::exception& unknown) {
    return {static_cast<int>(ExitCode::Internal), std::string("internal error: ") + unknown.what()};
  } catch (...) {
    return {static_cast<int>(ExitCode::Internal), "internal error"};
  }
}

/// A shared-memory window and the handle that frees it on every rank. Freeing waits for all ranks.
/// When an exception passes, it may be on this rank alone; then freeing is left to the end of the
/// process.
struct NodeWindow {
  MPI_Win window = MPI_WIN_NULL;
  int exceptions = std::uncaught_exceptions();
  ~NodeWindow() {
    if (window == MPI_WIN_NULL || std::uncaught_exceptions() > exceptions) return;
    const WaitNote waits;
    MPI_Win_free(&window);
  }
};

/// Aligned as node memory is.
std::shared_ptr<std::byte> memory_of_process(std::size_t bytes) {
  constexpr std::align_val_t kAlignment{Communicator::kNodeMemoryAlignment};
  return {static_cast<std::byte*>(::operator new(bytes, kAlignment)),
          [](std::byte* memory) { ::operator delete(memory, kAlignment); }};
}

}  // namespace

Communicator::Impl::~Impl() {
  // As with NodeWindow: the other ranks may not come here.
  if (is_owned && handle != MPI_COMM_NULL && std::uncaught_exceptions() == 0)
    MPI_Comm_free(&handle);
}

Communicator Communicator::world() {
  return Communicator(std::make_shared<Impl>(MPI_COMM_WORLD, false));
}

Communicator Communicator::alone() {
  return Communicator(std::make_shared<Impl>(MPI_COMM_NULL, false));
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
  std::vector<std::vector<std::byte>> parts(static_cast<std::size_t>(size()));
  for (int source = 0; source < size(); ++source) {
    auto& part = parts[static_cast<std::size_t>(source)];
    if (source == rank()) part.assign(mine.begin(), mine.end());
    std::uint64_t bytes = part.size();
    require_success(MPI_Bcast(&bytes, 1, MPI_UINT64_T, source, impl_->handle), "MPI_Bcast");
    part.resize(bytes);
    for (std::size_t first = 0; first < part.size(); first += kLargestPiece)
      require_success(MPI_Bcast(part.data() + first,
                                static_cast<int>(std::min(kLargestPiece, part.size() - first)),
                                MPI_BYTE,
                                source,
                                impl_->handle),
                      "MPI_Bcast");
  }
  return parts;
}

Communicator Communicator::node() const {
  if (is_alone(impl_->handle)) return *this;
  MPI_Comm node_handle = MPI_COMM_NULL;
  require_success(
      MPI_Comm_split_type(impl_->handle, MPI_COMM_TYPE_SHARED, rank(), MPI_INFO_NULL, &node_handle),
      "MPI_Comm_split_type");
  return Communicator(std::make_shared<Impl>(node_handle, true));
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
  if (is_alone(impl_->handle)) {
    std::shared_ptr<std::byte> memory = memory_of_process(bytes);
    fill(std::span<std::byte>(memory.get(), bytes), 0, 1);
    return memory;
  }
  const Communicator on_node = node();
  auto owner = std::make_shared<NodeWindow>();
  std::byte* base = nullptr;
  // Open MPI chooses the alignment, on two ranks 8 bytes.
  const auto my_bytes =
      static_cast<MPI_Aint>(on_node.is_root() ? bytes + kNodeMemoryAlignment - 1 : 0);
  require_success(MPI_Win_allocate_shared(
                      my_bytes, 1, MPI_INFO_NULL, on_node.impl_->handle, &base, &owner->window),
                  "MPI_Win_allocate_shared");
  MPI_Aint shared_bytes = 0;
  int unit = 1;
  require_success(MPI_Win_shared_query(owner->window, 0, &shared_bytes, &unit, &base),
                  "MPI_Win_shared_query");
  const auto beyond = reinterpret_cast<std::uintptr_t>(base) % kNodeMemoryAlignment;
  std::array<std::uint64_t, 1> skipped = {
      on_node.is_root() ? (kNodeMemoryAlignment - beyond) % kNodeMemoryAlignment : 0};
  on_node.maximum(skipped);
  base += skipped[0];
  // On all nodes: ranks of another node would otherwise go on to a collective call that these ranks
  // never reach.
  all_or_none(*this,
              [&] { fill(std::span<std::byte>(base, bytes), on_node.rank(), on_node.size()); });
  on_node.barrier();
  return {owner, base};
}

std::shared_ptr<const std::byte> Communicator::allocate_on_nodes_from_root(
    std::size_t bytes, const std::function<void(std::span<std::byte>)>& fill) const {
  if (is_alone(impl_->handle)) return allocate_on_node(bytes, fill);
  std::span<std::byte> memory;
  bool is_first_of_node = false;
  auto owner =
      allocate_on_node_together(bytes, [&](std::span<std::byte> on_node, int part, int /*parts*/) {
        memory = on_node;
        is_first_of_node = part == 0;
      });
  all_or_none(*this, [&] {
    if (is_root()) fill(memory);
  });
  MPI_Comm first_ranks = MPI_COMM_NULL;
  require_success(
      MPI_Comm_split(impl_->handle, is_first_of_node ? 0 : MPI_UNDEFINED, rank(), &first_ranks),
      "MPI_Comm_split");
  if (is_first_of_node) {
    const WaitNote waits;
    broadcast_bytes(first_ranks, memory);
    MPI_Comm_free(&first_ranks);
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
  // The unit that a rank was at tells more than its number; a stop is not a failure.
  const std::string unit = take_failed_unit();
  if (!unit.empty() && failure.exit_code != static_cast<int>(ExitCode::Stopped))
    failure.message = unit + ": " + failure.message;
  return failure;
}

void throw_failure(const RankFailure& failure) {
  throw RemoteError(static_cast<ExitCode>(failure.exit_code), failure.message);
}

}  // namespace af
