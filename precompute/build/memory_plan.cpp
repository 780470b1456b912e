// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/memory_plan.h"

#include <algorithm>
#include <fstream>
#include <sstream>

#include "base/error.h"
#include "precompute/casting/least_squares_caster.h"

namespace af {

namespace {

/// Memory for the indices of one round: the blocks, HDF5's chunks and what they compress to.
constexpr std::uint64_t kRoundBytes = std::uint64_t{32} << 20;
/// HDF5's index of the chunks while they are written: 100 bytes for a chunk of 8192 tiles.
constexpr double kChunkIndexBytesPerTile = 100.0 / 8192.0;
/// A rank's part of all tiles may exceed the mean by this.
constexpr double kLargestShare = 1.3;
/// Held-out tiles come on top of the training tiles.
constexpr double kWithHeldOut = 1.125;

std::string mebibytes(std::uint64_t bytes) {
  std::ostringstream text;
  text.precision(4);
  text << static_cast<double>(bytes) / 0x1.0p20 << " MiB";
  return text.str();
}

/// Samples, tiles, and the casters' working arrays of the largest unit.
double unit_bytes(const std::vector<WorkUnit>& units, bool fits_uv) {
  double most = 0.0;
  for (const WorkUnit& unit : units) {
    const double samples = 2.0 * static_cast<double>(unit.sample_count());
    const double fitted =
        fits_uv ? 2.0 * static_cast<double>(LeastSquaresFieldCaster::held_samples(unit)) : 0.0;
    const int u_count = unit.u.count + (fits_uv ? 2 : 0);
    const double sums = 4.0 * kRunOfT * u_count * unit.s.count;
    // Tiles are made once the line integrals to which samples are fitted are gone.
    most = std::max(most, samples + std::max(samples, fitted) + sums);
  }
  constexpr double kBuffers = 4.0 * 0x1.0p20;
  return most + kBuffers;
}

}  // namespace

std::uint64_t MemoryPlan::least_bytes() const {
  return fixed_bytes + std::max({casting_bytes, training_bytes, encoding_bytes});
}

std::uint64_t MemoryPlan::kept_tile_bytes(std::uint64_t limit_bytes) const {
  return limit_bytes - std::min(limit_bytes, least_bytes());
}

MemoryPlan plan_memory(const FieldLattice& lattice,
                       const std::vector<WorkUnit>& units,
                       const PrecomputeOptions& options,
                       std::uint64_t fixed_bytes,
                       int ranks) {
  const double unit = unit_bytes(units, options.design().fits_uv);
  const TrainingSelection training = options.training_selection();
  const double fraction_tiles = training.fraction * static_cast<double>(lattice.tile_count());
  const auto cap = static_cast<double>(training.max_training_tiles);
  constexpr double kCandidateBytes = sizeof(NumberedTile);
  // The picker holds up to an eighth above the cap before it drops what lies beyond.
  const double candidates =
      kWithHeldOut * std::min(1.125 * cap, kLargestShare * fraction_tiles / ranks);
  const double share = kWithHeldOut * std::min(cap, fraction_tiles) / ranks;
  // A tile, its nearest codeword, its error and a key.
  constexpr double kTrainingBytes = kCandidateBytes + 4.0 + 8.0 + 8.0;
  // Sums and their reduction, search coefficients, and drawn codewords.
  constexpr double kBytesPerCodeword = 600.0;
  const double codebook = kBytesPerCodeword * options.design().codewords;
  MemoryPlan plan;
  plan.fixed_bytes = fixed_bytes;
  plan.casting_bytes = static_cast<std::uint64_t>(kCandidateBytes * candidates + unit);
  // While the share is copied from the candidates, both exist.
  plan.training_bytes = static_cast<std::uint64_t>(
      std::max(kTrainingBytes * share + codebook, kCandidateBytes * (candidates + share)));
  const double chunk_index = kChunkIndexBytesPerTile * static_cast<double>(lattice.tile_count());
  plan.encoding_bytes = static_cast<std::uint64_t>(codebook + unit + chunk_index) + kRoundBytes;
  return plan;
}

std::uint64_t memory_limit(const PrecomputeOptions& options, const MemoryPlan& plan) {
  const std::uint64_t least = plan.least_bytes();
  if (options.memory_limit_bytes == 0) return std::max(kDefaultMemoryLimitBytes, least);
  if (options.memory_limit_bytes < least)
    throw InputError("memory_limit",
                     mebibytes(options.memory_limit_bytes) + " per rank",
                     "a rank needs " + mebibytes(least) +
                         " even when it keeps no tiles: raise it, or lower --max-training-tiles, "
                         "--codewords or the number of nodes");
  return options.memory_limit_bytes;
}

ProcessMemory measured_memory() {
  std::ifstream status("/proc/self/status");
  ProcessMemory memory;
  std::uint64_t peak = 0;
  for (std::string line; std::getline(status, line);) {
    std::istringstream words(line);
    std::string name;
    std::uint64_t kibibytes = 0;
    words >> name >> kibibytes;
    if (name == "RssAnon:") memory.own_bytes = kibibytes << 10u;
    if (name == "RssFile:") memory.program_bytes = kibibytes << 10u;
    if (name == "RssShmem:") memory.shared_bytes = kibibytes << 10u;
    if (name == "VmHWM:") peak = kibibytes << 10u;
  }
  memory.peak_own_bytes = peak - std::min(peak, memory.program_bytes + memory.shared_bytes);
  return memory;
}

void forget_peak() {
  std::ofstream("/proc/self/clear_refs") << "5";
}

}  // namespace af
