// SPDX-License-Identifier: Apache-2.0
#include "benchmark/scale_simulation.h"

#include <gtest/gtest.h>

namespace af::benchmark {
namespace {

constexpr ItemTimes kEven{"even", 0.01, 0.0, 0.0, 64};
constexpr QueueCosts kFree{0.0, 0.0, 0.0, 0.0, 0.0, 100.0, 10.0};

constexpr std::int64_t kMostPerBlock = 64;

SimulatedRun run(int ranks, std::int64_t items, const QueueCosts& costs, RowsGo rows) {
  return simulated_run({ranks, items, kMostPerBlock, rows, 1}, kEven, costs);
}

TEST(ScaleSimulation, WithoutCostsEvenItemsAreSharedEvenly) {
  // 16 ranks, 1600 items: 100 each; blocks shrink, so that at most one item is waited for.
  const SimulatedRun result = run(16, 1600, kFree, RowsGo::ToRankZero);
  EXPECT_NEAR(result.seconds, 1.0, 0.01 + 1e-9);
  EXPECT_GE(result.efficiency, 0.99);
  EXPECT_EQ(result.manager_busy, 0.0);
  EXPECT_EQ(result.kept_bytes, 16000.0);
}

TEST(ScaleSimulation, RankZeroIsTheLimitWhenRowsCostMoreThanTheirShare) {
  QueueCosts costs = kFree;
  costs.receive_seconds = 0.001;  // 10 ranks' worth of items of 10 ms
  const SimulatedRun result = run(100, 20000, costs, RowsGo::ToRankZero);
  // All rows one after the other, after the first block has come.
  EXPECT_NEAR(result.seconds, 20000 * 0.001, 0.01 * 64 + 0.01);
  EXPECT_GT(result.manager_busy, 0.95);
  EXPECT_LT(result.efficiency, 0.11);
}

TEST(ScaleSimulation, OwnShardsTakeRowsOffRankZero) {
  QueueCosts costs = kFree;
  costs.receive_seconds = costs.write_seconds = 0.001;
  const SimulatedRun result = run(100, 20000, costs, RowsGo::ToOwnShard);
  EXPECT_NEAR(result.seconds, 200 * 0.011, 0.011 + 1e-9);
  EXPECT_EQ(result.manager_busy, 0.0);
  EXPECT_EQ(result.kept_bytes, 0.0);
}

TEST(ScaleSimulation, CountsEveryRowOnceAndEveryRequest) {
  const SimulatedRun result = run(2, 10, kFree, RowsGo::ToRankZero);
  // At most all rows come from rank 1; rank 0 sends its own nowhere. A request takes 24 bytes.
  EXPECT_LE(result.manager_bytes, 10 * 100.0 + static_cast<double>(result.requests) * 24.0);
  EXPECT_GE(result.requests, 2);
}

TEST(ItemTimes, MeanOfALogNormal) {
  const ItemTimes times{"x", 2.0, 1.0, 0.0, 64};
  EXPECT_NEAR(times.mean_seconds(), 2.0 * 1.6487212707, 1e-9);
}

}  // namespace
}  // namespace af::benchmark
