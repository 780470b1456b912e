// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace af::benchmark {

/// What the model assumes of a cluster; none of this is measured.
struct ClusterAssumptions {
  int cores_per_node = 64;
  double latency_seconds = 2e-6;              ///< of one message between nodes
  double network_bytes_per_second = 12.5e9;   ///< of one node
  double file_system_bytes_per_second = 2e9;  ///< all ranks together
};

/// Seconds of one phase: the part that ranks share and the part that stays whatever their number.
struct PhaseCost {
  double shared_seconds = 0.0;
  double fixed_seconds = 0.0;
  double contention = 1.0;  ///< of shared_seconds, when there is more than one rank

  /// Amdahl, T(n) = fixed + shared / n: for phases with work that every rank or one rank does.
  static PhaseCost from_one_and_two_ranks(double one, double two);
  /// T(n) = contention * shared / n: for phases that ranks do apart, where they slow each other
  /// down only through caches and memory.
  static PhaseCost without_fixed_part(double one, double two);

  [[nodiscard]] double seconds(int ranks) const;
};

/// One job as measured.
struct JobCosts {
  double start_seconds = 0.0;  ///< beside the phases
  double read_seconds = 0.0;
  PhaseCost resample;  ///< shared by the ranks of a node only
  PhaseCost cast;
  PhaseCost train;
  PhaseCost encode;
  PhaseCost write;
  double ct_bytes = 0.0;       ///< broadcast to every node
  double reduced_bytes = 0.0;  ///< per training iteration
  int training_iterations = 0;
  double file_bytes = 0.0;
  double units_per_rank = 16.0;   ///< of casting
  double hand_out_seconds = 0.0;  ///< rank 0's time per unit
};

/// The same program on a larger field: `rays` and `training_tiles` are ratios to the job measured.
JobCosts scaled(const JobCosts& job, double rays, double training_tiles);

struct ModelledRun {
  int ranks = 1;
  double start = 0.0;  ///< with reading and resampling
  double cast = 0.0;
  double train = 0.0;
  double encode = 0.0;
  double write = 0.0;

  [[nodiscard]] double total() const { return start + cast + train + encode + write; }
};

/// Seconds of a job on `ranks` ranks of a cluster. Sums over ranks: Rabenseifner's algorithm,
/// 2 log2(n) latencies and twice the bytes over the network. Casting: an even share, the tail of
/// one unit, and never faster than rank 0 hands out units.
ModelledRun modelled_run(const JobCosts& job, const ClusterAssumptions& cluster, int ranks);

/// Share of the ranks' time that a run on one rank would have needed, in [0, 1].
double parallel_efficiency(const ModelledRun& alone, const ModelledRun& run);

}  // namespace af::benchmark
