// SPDX-License-Identifier: Apache-2.0
#include "benchmark/scaling_model.h"

#include <algorithm>
#include <cmath>

namespace af::benchmark {

namespace {

double sum_over_ranks_seconds(double bytes, const ClusterAssumptions& cluster, int ranks) {
  if (ranks == 1) return 0.0;
  return 2.0 * std::log2(ranks) * cluster.latency_seconds +
         2.0 * bytes / cluster.network_bytes_per_second;
}

double broadcast_seconds(double bytes, const ClusterAssumptions& cluster, int nodes) {
  if (nodes == 1) return 0.0;
  return std::ceil(std::log2(nodes)) * cluster.latency_seconds +
         2.0 * bytes / cluster.network_bytes_per_second;
}

double cast_seconds(const JobCosts& job, int ranks) {
  const double even = job.cast.seconds(ranks);
  if (ranks == 1) return even;
  const double tail = even / job.units_per_rank;
  return std::max(even + tail, job.hand_out_seconds * job.units_per_rank * ranks);
}

}  // namespace

PhaseCost PhaseCost::from_one_and_two_ranks(double one, double two) {
  const double fixed = std::clamp(2.0 * two - one, 0.0, one);
  return {one - fixed, fixed, 1.0};
}

PhaseCost PhaseCost::without_fixed_part(double one, double two) {
  return {one, 0.0, 2.0 * two / one};
}

double PhaseCost::seconds(int ranks) const {
  return fixed_seconds + shared_seconds * (ranks == 1 ? 1.0 : contention) / ranks;
}

JobCosts scaled(const JobCosts& job, double rays, double training_tiles) {
  JobCosts larger = job;
  const auto grow = [](PhaseCost& cost, double factor) {
    cost.shared_seconds *= factor;
    cost.fixed_seconds *= factor;
  };
  grow(larger.cast, rays);
  grow(larger.encode, rays);
  grow(larger.write, rays);
  // The codebook, and with it what each iteration does besides the search, stays the same.
  larger.train.shared_seconds *= training_tiles;
  larger.file_bytes *= rays;
  return larger;
}

ModelledRun modelled_run(const JobCosts& job, const ClusterAssumptions& cluster, int ranks) {
  const int nodes = (ranks + cluster.cores_per_node - 1) / cluster.cores_per_node;
  ModelledRun run;
  run.ranks = ranks;
  run.start = job.start_seconds + job.read_seconds +
              broadcast_seconds(job.ct_bytes, cluster, nodes) +
              job.resample.seconds(std::min(ranks, cluster.cores_per_node));
  run.cast = cast_seconds(job, ranks);
  run.train = job.train.seconds(ranks) +
              job.training_iterations * sum_over_ranks_seconds(job.reduced_bytes, cluster, ranks);
  run.encode = job.encode.seconds(ranks);
  run.write =
      std::max(job.write.seconds(ranks), job.file_bytes / cluster.file_system_bytes_per_second);
  return run;
}

double parallel_efficiency(const ModelledRun& alone, const ModelledRun& run) {
  return alone.total() * alone.ranks / (run.total() * run.ranks);
}

}  // namespace af::benchmark
