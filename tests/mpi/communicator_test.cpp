// SPDX-License-Identifier: Apache-2.0
#include "ranks/communicator.h"

#include <cstring>
#include <tuple>

#include <gtest/gtest.h>

#include "base/error.h"

namespace af {
namespace {

TEST(Communicator, SumsExactlyOverRanks) {
  const Communicator world = Communicator::world();
  std::vector<std::uint64_t> values{
      1, static_cast<std::uint64_t>(world.rank()), std::uint64_t{1} << 60};
  world.sum(values);
  const auto n = static_cast<std::uint64_t>(world.size());
  EXPECT_EQ(values, (std::vector<std::uint64_t>{n, n * (n - 1) / 2, n << 60}));
}

TEST(Communicator, BroadcastReplacesTextOfAnyLength) {
  const Communicator world = Communicator::world();
  std::string text = world.is_root() ? std::string(100000, 'x') : "other";
  world.broadcast(text);
  EXPECT_EQ(text, std::string(100000, 'x'));
}

TEST(Communicator, GathersPartsInRankOrderAlsoEmptyOnes) {
  const Communicator world = Communicator::world();
  const std::vector<std::byte> mine(static_cast<std::size_t>(world.rank()),
                                    std::byte(world.rank()));
  const auto everywhere = world.all_gather(mine);
  ASSERT_EQ(everywhere.size(), static_cast<std::size_t>(world.size()));
  for (std::size_t rank = 0; rank < everywhere.size(); ++rank)
    EXPECT_EQ(everywhere[rank], std::vector<std::byte>(rank, std::byte(rank)));
}

// Texts are sent in pieces, and one that is longer than all others in several.
TEST(Communicator, SendsTextsOfManyLengthsOneAfterTheOther) {
  const Communicator world = Communicator::world();
  for (const std::size_t length : {0U, 1U, 0U, 4194303U, 4194304U, 10000001U, 0U, 3U}) {
    std::string text = world.is_root() ? std::string(length, 'x') : "other";
    world.broadcast(text);
    ASSERT_EQ(text, std::string(length, 'x'));
    const auto everywhere = world.all_gather(std::as_bytes(std::span(text)));
    for (const auto& part : everywhere) ASSERT_EQ(part.size(), length);
  }
}

TEST(Communicator, ReducesMoreThanAMailboxHolds) {
  const Communicator world = Communicator::world();
  std::vector<std::uint64_t> values(1000003);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = i + static_cast<std::size_t>(world.rank());
  std::vector<std::uint64_t> largest = values;
  world.sum(values);
  world.maximum(largest);
  const auto n = static_cast<std::uint64_t>(world.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_EQ(values[i], n * i + n * (n - 1) / 2) << i;
    ASSERT_EQ(largest[i], i + n - 1) << i;
  }
}

TEST(Communicator, GathersPartsOfVeryDifferentSizes) {
  const Communicator world = Communicator::world();
  const auto size_of = [&](int rank) { return rank == 0 ? std::size_t{3000000} : std::size_t{5}; };
  const std::vector<std::byte> mine(size_of(world.rank()), std::byte(world.rank() + 1));
  const auto everywhere = world.all_gather(mine);
  for (int rank = 0; rank < world.size(); ++rank)
    EXPECT_EQ(everywhere[static_cast<std::size_t>(rank)],
              std::vector<std::byte>(size_of(rank), std::byte(rank + 1)));
}

// Letting go of it is no collective call. If it were, ranks that fail at different places, or not
// at all, would wait for each other for ever.
TEST(Communicator, RanksLetGoOfNodeMemoryEachInItsOwnOrder) {
  const Communicator world = Communicator::world();
  const auto make = [&] {
    return world.allocate_on_node(
        1000, [](std::span<std::byte> bytes) { std::memset(bytes.data(), 7, bytes.size()); });
  };
  auto first = make();
  auto second = make();
  (world.rank() % 2 == 0 ? first : second).reset();
  world.barrier();
  EXPECT_EQ((world.rank() % 2 == 0 ? second : first).get()[999], std::byte(7));
  try {
    const auto mine = std::move(world.rank() % 2 == 0 ? second : first);
    if (world.is_root()) throw FileError("a.h5", "is torn");
  } catch (const Error&) {
  }
  world.barrier();
}

TEST(Communicator, NodeMemoryThatHasNoRoomIsRefusedOnEveryRank) {
  const Communicator world = Communicator::world();
  if (world.size() == 1) GTEST_SKIP() << "a process alone has memory of its own";
  EXPECT_THROW(std::ignore = world.allocate_on_node(std::size_t{1} << 50, [](auto) {}), Error);
}

TEST(Communicator, ANodeIsFoundOnce) {
  const Communicator world = Communicator::world();
  EXPECT_EQ(world.node().group(), Communicator::world().node().group());
}

TEST(Communicator, NodeMemoryIsFilledOnceAndSeenByAll) {
  const Communicator world = Communicator::world();
  const auto memory = world.allocate_on_node(
      1000, [](std::span<std::byte> bytes) { std::memset(bytes.data(), 7, bytes.size()); });
  EXPECT_EQ(memory.get()[999], std::byte(7));
}

TEST(Communicator, NodeMemoryIsAlignedWhateverItsSize) {
  const Communicator world = Communicator::world();
  for (const std::size_t bytes : {1U, 8U, 63U, 64U, 65U, 4096U, 100001U}) {
    const auto memory = world.allocate_on_node(bytes, [](std::span<std::byte> all) {
      for (std::size_t i = 0; i < all.size(); ++i) all[i] = std::byte(i % 251);
    });
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(memory.get()) % Communicator::kNodeMemoryAlignment,
              0U)
        << bytes;
    for (std::size_t i = 0; i < bytes; ++i) ASSERT_EQ(memory.get()[i], std::byte(i % 251)) << i;
  }
}

TEST(Communicator, NodeMemoryFromRankZeroIsFilledThereAloneAndSeenByAll) {
  const Communicator world = Communicator::world();
  int fills = 0;
  const auto memory = world.allocate_on_nodes_from_root(1000, [&](std::span<std::byte> bytes) {
    ++fills;
    std::memset(bytes.data(), 9, bytes.size());
  });
  EXPECT_EQ(memory.get()[999], std::byte(9));
  EXPECT_EQ(fills, world.is_root() ? 1 : 0);
  EXPECT_THROW(std::ignore = world.allocate_on_nodes_from_root(
                   8, [](std::span<std::byte>) { throw FileError("a.h5", "is torn"); }),
               Error);
}

TEST(Communicator, NodeMemoryFromRankZerosNodeIsFilledByItsRanksTogether) {
  const Communicator world = Communicator::world();
  // The ranks of the tests are on one node.
  const auto memory = world.allocate_on_nodes_from_root_together(
      static_cast<std::size_t>(world.size()), [&](std::span<std::byte> bytes, int part, int parts) {
        EXPECT_EQ(part, world.rank());
        EXPECT_EQ(parts, world.size());
        bytes[static_cast<std::size_t>(part)] = std::byte(part + 1);
      });
  for (int rank = 0; rank < world.size(); ++rank)
    EXPECT_EQ(memory.get()[rank], std::byte(rank + 1)) << rank;
  const auto fill = [&](std::span<std::byte>, int part, int parts) {
    if (part == parts - 1) throw FileError("a.h5", "is torn");
  };
  EXPECT_THROW(std::ignore = world.allocate_on_nodes_from_root_together(8, fill), Error);
}

/// There are other ranks, and every one is alone all the same. library_test does this where there
/// are none.
TEST(CommunicatorAlone, NeedsNoMpi) {
  const Communicator alone = Communicator::alone();
  EXPECT_EQ(alone.rank(), 0);
  EXPECT_EQ(alone.size(), 1);
  if (Communicator::world().is_root()) {  // a collective call would wait for the other ranks
    alone.barrier();
    std::vector<std::uint64_t> values{3};
    alone.sum(values);
    alone.maximum(values);
    EXPECT_EQ(values, std::vector<std::uint64_t>{3});
    std::string text = "mine";
    alone.broadcast(text);
    EXPECT_EQ(text, "mine");
    const std::vector<std::byte> bytes(5, std::byte{4});
    EXPECT_EQ(alone.all_gather(bytes), (std::vector<std::vector<std::byte>>{bytes}));
    EXPECT_EQ(alone.node().size(), 1);
    const auto memory = alone.allocate_on_nodes_from_root(
        100, [](std::span<std::byte> all) { std::memset(all.data(), 7, all.size()); });
    EXPECT_EQ(memory.get()[99], std::byte{7});
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(memory.get()) % Communicator::kNodeMemoryAlignment,
              0U);
    EXPECT_THROW(all_or_none(alone, [] { throw InputError("no"); }), Error);
  }
}

TEST(AllOrNone, ThrowsTheLoneRanksErrorEverywhere) {
  const Communicator world = Communicator::world();
  const int failing = world.size() - 1;
  try {
    all_or_none(world, [&] {
      if (world.rank() == failing) throw InputError("size", "7", "must be even", "a.toml");
    });
    ADD_FAILURE() << "no error on rank " << world.rank();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::Input);
    EXPECT_NE(std::string(error.what()).find("a.toml: size = 7: must be even"), std::string::npos);
    if (world.size() > 1) {
      const std::string who = "rank " + std::to_string(failing) + " on ";  // a host follows
      EXPECT_EQ(std::string(error.what()).rfind(who, 0), 0u);
    }
  }
}

TEST(AllOrNone, ReturnsEachRanksOwnValue) {
  const Communicator world = Communicator::world();
  EXPECT_EQ(all_or_none(world, [&] { return world.rank(); }), world.rank());
}

}  // namespace
}  // namespace af
