// SPDX-License-Identifier: Apache-2.0
#include "ranks/communicator.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <new>
#include <sys/mman.h>

#include "base/error.h"
#include "base/host_name.h"
#include "ranks/node_memory_file.h"
#include "ranks/rank_group.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

std::uint64_t size_at_root(RankGroup& ranks, std::uint64_t size) {
  ranks.broadcast(std::as_writable_bytes(std::span(&size, 1)));
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

std::shared_ptr<RankGroup>& ranks_of_job() {
  static std::shared_ptr<RankGroup> ranks;
  return ranks;
}

Communicator Communicator::world() {
  return Communicator(ranks_of_job());
}

Communicator Communicator::alone() {
  return Communicator(nullptr);
}

Communicator::Communicator(std::shared_ptr<RankGroup> group) : group_(std::move(group)) {
  if (group_ == nullptr) return;
  rank_ = group_->rank();
  size_ = group_->size();
}

void Communicator::barrier() const {
  if (size_ == 1) return;
  const WaitNote waits;
  group_->barrier();
}

void Communicator::sum(std::span<std::uint64_t> values) const {
  if (size_ == 1) return;
  const WaitNote waits;
  group_->reduce(values, RankGroup::Reduction::Sum);
}

void Communicator::maximum(std::span<std::uint64_t> values) const {
  if (size_ == 1) return;
  const WaitNote waits;
  group_->reduce(values, RankGroup::Reduction::Maximum);
}

void Communicator::broadcast(std::vector<std::byte>& bytes) const {
  if (size_ == 1) return;
  const WaitNote waits;
  bytes.resize(size_at_root(*group_, bytes.size()));
  group_->broadcast(bytes);
}

void Communicator::broadcast(std::string& text) const {
  if (size_ == 1) return;
  const WaitNote waits;
  text.resize(size_at_root(*group_, text.size()));
  group_->broadcast(std::as_writable_bytes(std::span(text)));
}

std::vector<std::vector<std::byte>> Communicator::all_gather(
    std::span<const std::byte> mine) const {
  if (size_ == 1) return {{mine.begin(), mine.end()}};
  const WaitNote waits;
  return group_->all_gather(mine);
}

Communicator Communicator::node() const {
  if (size_ == 1) return *this;
  const WaitNote waits;
  std::shared_ptr<RankGroup> node = group_->node();
  return node == nullptr ? *this : Communicator(std::move(node));
}

std::shared_ptr<std::byte> Communicator::allocate_on_node(std::size_t bytes) const {
  return size_ == 1 ? memory_of_process(bytes) : memory_of_node(*this, node(), bytes);
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
  if (size_ == 1) {
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
  if (size_ == 1) return allocate_on_node_together(bytes, fill);
  const Communicator on_node = node();
  std::array<std::uint64_t, 1> is_roots_node{is_root() ? std::uint64_t{1} : std::uint64_t{0}};
  on_node.maximum(is_roots_node);
  auto owner = allocate_on_node(bytes);
  const std::span<std::byte> memory(owner.get(), bytes);
  all_or_none(*this, [&] {
    if (is_roots_node[0] != 0) fill(memory, on_node.rank(), on_node.size());
  });
  {
    const WaitNote waits;
    group_->broadcast_to_nodes(memory);
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
