// SPDX-License-Identifier: Apache-2.0
#include "drr/atlas_renderers.h"

#include <atomic>
#include <thread>

#include <gtest/gtest.h>

#include "base/error.h"

namespace af {
namespace {

std::shared_ptr<const MemberLevels> some_levels() {
  return std::make_shared<const MemberLevels>();
}

TEST(MembersInUse, KeepsThoseThatWereUsedLast) {
  std::vector<std::size_t> opened;
  MembersInUse members(
      [&](std::size_t member) {
        opened.push_back(member);
        return some_levels();
      },
      3);
  for (const std::size_t member : {0u, 1u, 2u, 0u, 3u}) members.get(member);
  EXPECT_EQ(members.count(), 3u);
  // Member 1, the least recently used, was dropped.
  members.get(0);
  members.get(2);
  members.get(3);
  EXPECT_EQ(opened, (std::vector<std::size_t>{0, 1, 2, 3}));
  members.get(1);
  EXPECT_EQ(opened.size(), 5u);
}

TEST(MembersInUse, KeepsForGoodWhatItIsGiven) {
  int opened = 0;
  MembersInUse members(
      [&](std::size_t) {
        ++opened;
        return some_levels();
      },
      2);
  const auto given = some_levels();
  members.keep(7, given);
  for (std::size_t member = 0; member < 5; ++member) members.get(member);
  EXPECT_EQ(members.get(7), given);
  EXPECT_EQ(opened, 5);
  EXPECT_EQ(members.count(), 2u);
}

TEST(MembersInUse, WhatIsLetGoStaysUsable) {
  MembersInUse members([](std::size_t) { return some_levels(); }, 2);
  const auto held = members.get(0);
  members.get(1);
  members.get(2);
  EXPECT_NE(members.get(0), held);
  EXPECT_EQ(held->size(), 0u);
}

TEST(MembersInUse, OpensOnceForSeveralThreadsAndPassesErrorsOn) {
  std::atomic<int> opened = 0;
  MembersInUse members(
      [&](std::size_t member) {
        if (member == 9) throw FileError("a.h5", "is gone");
        ++opened;
        return some_levels();
      },
      4);
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i)
    threads.emplace_back([&] {
      for (std::size_t member = 0; member < 3; ++member) members.get(member);
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(opened, 3);
  EXPECT_THROW(members.get(9), FileError);
  EXPECT_THROW(members.get(9), FileError);
}

}  // namespace
}  // namespace af
