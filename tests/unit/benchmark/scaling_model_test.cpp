// SPDX-License-Identifier: Apache-2.0
#include "benchmark/scaling_model.h"

#include <gtest/gtest.h>

namespace af::benchmark {
namespace {

/// Sums of a few doubles.
constexpr double kRounding = 1e-12;

JobCosts even_job() {
  JobCosts job;
  job.cast = {8.0, 0.0, 1.0};
  job.train = {4.0, 1.0, 1.0};
  job.encode = {4.0, 0.0, 1.0};
  job.write = {0.0, 0.5, 1.0};
  return job;
}

TEST(PhaseCost, HasNoFixedPartWhenTwoRanksHalveTheTime) {
  const PhaseCost cost = PhaseCost::from_one_and_two_ranks(6.0, 3.0);
  EXPECT_DOUBLE_EQ(cost.shared_seconds, 6.0);
  EXPECT_DOUBLE_EQ(cost.fixed_seconds, 0.0);
}

TEST(PhaseCost, IsAllFixedWhenTwoRanksGainNothing) {
  const PhaseCost cost = PhaseCost::from_one_and_two_ranks(6.0, 6.5);
  EXPECT_DOUBLE_EQ(cost.shared_seconds, 0.0);
  EXPECT_DOUBLE_EQ(cost.fixed_seconds, 6.0);
}

TEST(PhaseCost, SplitsByAmdahl) {
  const PhaseCost cost = PhaseCost::from_one_and_two_ranks(6.0, 4.0);
  EXPECT_DOUBLE_EQ(cost.shared_seconds, 4.0);
  EXPECT_DOUBLE_EQ(cost.fixed_seconds, 2.0);
}

TEST(PhaseCost, LosesToItsNeighboursFromTwoRanksOn) {
  const PhaseCost cost = PhaseCost::without_fixed_part(4.0, 2.5);
  EXPECT_DOUBLE_EQ(cost.seconds(1), 4.0);
  EXPECT_DOUBLE_EQ(cost.seconds(2), 2.5);
  EXPECT_DOUBLE_EQ(cost.seconds(10), 0.5);
}

TEST(ScalingModel, GivesOneRankTheMeasuredSeconds) {
  const ModelledRun alone = modelled_run(even_job(), ClusterAssumptions{}, 1);
  EXPECT_NEAR(alone.total(), 8.0 + 5.0 + 4.0 + 0.5, kRounding);
  EXPECT_NEAR(parallel_efficiency(alone, alone), 1.0, kRounding);
}

TEST(ScalingModel, EndsCastingOneUnitAfterTheEvenShare) {
  const ModelledRun four = modelled_run(even_job(), ClusterAssumptions{}, 4);
  EXPECT_NEAR(four.cast, 2.0 + 2.0 / 16.0, kRounding);
}

TEST(ScalingModel, CannotCastFasterThanUnitsAreHandedOut) {
  JobCosts job = even_job();
  job.hand_out_seconds = 1e-3;
  const ModelledRun run = modelled_run(job, ClusterAssumptions{}, 1024);
  EXPECT_NEAR(run.cast, 1e-3 * 16.0 * 1024.0, kRounding);
}

TEST(ScalingModel, WritesNoFasterThanTheFileSystem) {
  JobCosts job = even_job();
  job.file_bytes = 8e9;
  ClusterAssumptions cluster;
  cluster.file_system_bytes_per_second = 2e9;
  EXPECT_NEAR(modelled_run(job, cluster, 4096).write, 4.0, kRounding);
}

TEST(ScalingModel, ScalesTheSearchOfTrainingButNotTheCodebook) {
  const JobCosts larger = scaled(even_job(), 64.0, 2.5);
  EXPECT_DOUBLE_EQ(larger.cast.shared_seconds, 512.0);
  EXPECT_DOUBLE_EQ(larger.train.shared_seconds, 10.0);
  EXPECT_DOUBLE_EQ(larger.train.fixed_seconds, 1.0);
}

}  // namespace
}  // namespace af::benchmark
