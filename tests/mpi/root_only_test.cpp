// SPDX-License-Identifier: Apache-2.0
#include "ranks/root_only.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>

#include <gtest/gtest.h>

namespace af {
namespace {

// A value of rank 0 does not pass for one that every rank has, nor a rank's own value for a shared
// one.
static_assert(!std::is_convertible_v<RootOnly<int>, int>);
static_assert(!std::is_constructible_v<Shared<int>, int>);
static_assert(!std::is_constructible_v<Shared<int>, RootOnly<int>>);
static_assert(std::is_convertible_v<const Shared<std::string>&, const std::string&>);

struct Measured {
  std::string name;
  std::vector<double> values;
  std::filesystem::path path;
  std::map<std::string, std::string> places;

  auto members() { return std::tie(name, values, path, places); }
};

Measured example() {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  return {"skull", {1.0 / 3.0, -0.0, nan, 1e-300}, "a/b.h5", {{"ct", "study.toml:3"}, {"", ""}}};
}

int failing() {
  throw InputError("size", "7", "must be even", "a.toml");
}

/// Calls `collective`. On every rank it must throw what failing() throws on rank 0.
template <typename Collective>
void expect_failure_everywhere(Collective&& collective) {
  const Communicator world = Communicator::world();
  try {
    collective();
    ADD_FAILURE() << "no error on rank " << world.rank();
  } catch (const RemoteError& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::Input);
    const std::string text = error.what();
    EXPECT_NE(text.find("a.toml: size = 7: must be even"), std::string::npos) << text;
    EXPECT_EQ(text.rfind("rank 0 on ", 0) == 0, world.size() > 1) << text;
  }
}

TEST(RootOnly, WhatRankZeroFailsAtIsThrownOnEveryRankWithItsExitCode) {
  const Communicator world = Communicator::world();
  expect_failure_everywhere([&] { std::ignore = on_root(world, failing).share(); });
  expect_failure_everywhere([&] { std::ignore = on_root(world, failing).confirmed(); });
  expect_failure_everywhere([&] { do_on_root(world, [] { std::ignore = failing(); }); });
}

TEST(RootOnly, AFailureIsHandedOnAndNothingMoreIsDone) {
  const Communicator world = Communicator::world();
  int calls = 0;
  const auto more = on_root(world, failing).then([&](int value) {
    ++calls;
    return value;
  });
  expect_failure_everywhere([&] { std::ignore = more.then([](int) { return 1.0; }).share(); });
  EXPECT_EQ(calls, 0);
}

TEST(RootOnly, RankZeroAloneIsCalled) {
  const Communicator world = Communicator::world();
  int calls = 0;
  const auto made = on_root(world, [&] { return ++calls; });
  const Shared<int> doubled = made.then([&](int value) { return ++calls * value; }).share();
  do_on_root(world, [&] { ++calls; });
  EXPECT_EQ(calls, world.is_root() ? 3 : 0);
  EXPECT_EQ(*doubled, 2);
}

TEST(RootOnly, AValueThatIsSharedIsEqualOnEveryRank) {
  const Communicator world = Communicator::world();
  const Shared<Measured> shared = on_root(world, example).share();
  EXPECT_EQ(bytes_of(*shared), bytes_of(example()));
  EXPECT_TRUE(std::signbit(shared->values[1]));
  const std::string text = on_root(world, [] { return std::string(100000, 'x'); }).share();
  EXPECT_EQ(text, std::string(100000, 'x'));
  EXPECT_TRUE(on_root(world, [] { return std::vector<std::byte>(); }).share().take().empty());
}

TEST(RootOnly, CanBeReadOnRankZeroAlone) {
  const Communicator world = Communicator::world();
  auto confirmed = on_root(world, [] { return std::string("here"); }).confirmed();
  if (world.is_root()) {
    confirmed.value() += " alone";
    EXPECT_EQ(std::as_const(confirmed).value(), "here alone");
    EXPECT_THROW(std::ignore = on_root(world, failing).value(), std::logic_error);
  } else {
    EXPECT_THROW(std::ignore = confirmed.value(), std::logic_error);
  }
}

/// Every rank is rank 0 of a group of its own.
TEST(RootOnly, OfAProcessAloneIsItsOwn) {
  const Communicator world = Communicator::world();
  const int rank = on_root(Communicator::alone(), [&] { return world.rank(); }).share();
  EXPECT_EQ(rank, world.rank());
}

}  // namespace
}  // namespace af
