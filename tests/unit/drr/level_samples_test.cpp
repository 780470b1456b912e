// SPDX-License-Identifier: Apache-2.0
#include "drr/level_samples.h"

#include <array>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace af {
namespace {

constexpr SampleExtent kExtent{5, 3, 2};  // tiles at the end of both axes are padded
constexpr int kTiles = 3 * 2;

/// 100 u + 10 v + i + 1 as sample i of viewpoint (u, v).
void make_tile(int a, int b, std::span<std::uint16_t> samples) {
  for (int u = 2 * a; u < std::min(2 * a + 2, kExtent.u_nodes); ++u)
    for (int v = 2 * b; v < std::min(2 * b + 2, kExtent.v_nodes); ++v)
      for (int i = 0; i < 2; ++i)
        samples[static_cast<std::size_t>((u * kExtent.v_nodes + v) * 2 + i)] =
            static_cast<std::uint16_t>(100 * u + 10 * v + i + 1);
}

TEST(LevelSamples, MakesOnlyTheTilesOfWhatIsLookedAt) {
  std::vector<std::array<int, 2>> made;
  const LevelSamples samples(kExtent, process_memory(), [&](int a, int b, auto all) {
    made.push_back({a, b});
    make_tile(a, b, all);
  });
  EXPECT_EQ(samples.size(), 5 * 3 * 2 + kFieldLevelPadding);
  EXPECT_TRUE(made.empty());
  EXPECT_EQ(samples.viewpoints(3, 1)[1], 312);
  EXPECT_THAT(made, testing::ElementsAre(std::array{1, 0}));
  EXPECT_EQ(samples.viewpoints(1, 1, 2, 2)[0], 111);
  EXPECT_THAT(
      made,
      testing::ElementsAre(std::array{1, 0}, std::array{0, 0}, std::array{0, 1}, std::array{1, 1}));
  const LevelSamples copy = samples;  // shares what is made
  const auto all = copy.view();
  EXPECT_EQ(made.size(), kTiles);
  EXPECT_EQ(all[(4 * 3 + 2) * 2], 421);
  for (std::size_t i = 5 * 3 * 2; i < all.size(); ++i) EXPECT_EQ(all[i], 0);
}

TEST(LevelSamples, MakesWhatIsLookedAtOnceForAllThreads) {
  std::atomic<int> made = 0;
  const LevelSamples samples(kExtent, process_memory(), [&](int a, int b, auto all) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    make_tile(a, b, all);
    ++made;
  });
  std::vector<std::thread> threads;
  std::atomic<int> right = 0;
  for (int i = 0; i < 8; ++i)
    threads.emplace_back([&] { right += samples.view()[(2 * 3 + 1) * 2] == 211 ? 1 : 0; });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(made, kTiles);
  EXPECT_EQ(right, 8);
}

TEST(LevelSamples, ATileThatCouldNotBeMadeIsTriedAgain) {
  bool fails = true;
  const LevelSamples samples(kExtent, process_memory(), [&](int a, int b, auto all) {
    if (std::exchange(fails, false)) throw std::runtime_error("no memory");
    make_tile(a, b, all);
  });
  EXPECT_THROW(samples.viewpoints(0, 0), std::runtime_error);
  EXPECT_EQ(samples.viewpoints(0, 0)[0], 1);
}

/// In the child's copy of the memory a parent's thread is making a tile, but the child lacks that
/// thread.
TEST(LevelSamples, AForkedProcessGoesOnWithWhatItsParentWasMaking) {
  std::atomic<bool> is_making = false;
  std::atomic<bool> may_end = false;
  const pid_t parent = ::getpid();
  const LevelSamples samples(kExtent, process_memory(), [&](int a, int b, auto all) {
    is_making = true;
    while (::getpid() == parent && !may_end) std::this_thread::yield();
    make_tile(a, b, all);
  });
  std::thread maker([&] { samples.viewpoints(0, 0); });
  while (!is_making) std::this_thread::yield();
  const pid_t child = fork();
  if (child == 0) {
    ::alarm(60);
    ::_exit(samples.viewpoints(0, 0)[0] == 1 ? 0 : 1);
  }
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  may_end = true;
  maker.join();
}

TEST(LevelSamples, OfSamplesThatAreThereMakesNothing) {
  std::vector<std::uint16_t> values(5 * 3 * 2 + kFieldLevelPadding, 7);
  const LevelSamples samples(kExtent, std::move(values));
  EXPECT_EQ(samples.viewpoints(4, 2)[1], 7);
}

}  // namespace
}  // namespace af
