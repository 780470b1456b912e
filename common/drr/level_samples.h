// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace af {

/// Zero samples after the last one, so that kernels may load whole vectors.
inline constexpr std::size_t kFieldLevelPadding = 16;

/// Zeroed memory for samples. Its pages need not be touched before they are used.
struct SampleMemory {
  std::shared_ptr<std::byte> bytes;
  bool is_of_processes = false;  ///< whether other processes see it too
};
using FieldLevelMemory = std::function<SampleMemory(std::size_t bytes)>;

/// Memory of this process.
FieldLevelMemory process_memory();

/// How the samples of one slab lie: [u][v], with the same number for each viewpoint.
struct SampleExtent {
  int u_nodes = 0;
  int v_nodes = 0;
  std::size_t per_viewpoint = 0;
};

/// The 16-bit samples of one slab of a field's level, made when they are first looked at: a DRR
/// sees few viewpoints, and a search moves little. They are made tile by tile, where a tile is the
/// viewpoints 2a, 2a + 1 and 2b, 2b + 1. Whichever thread, or process that shares the memory, needs
/// a tile first makes it, and others that need it wait. Copies share the samples. Thread-safe.
/// \test LevelSamples.MakesWhatIsLookedAtOnceForAllThreads
class LevelSamples {
 public:
  /// Makes the samples of tile (a, b) at their place in `samples`, which holds all. Re-entrant, and
  /// makes the same every time.
  using MakeTile = std::function<void(int a, int b, std::span<std::uint16_t> samples)>;

  LevelSamples() = default;
  LevelSamples(const SampleExtent& extent, const FieldLevelMemory& memory, MakeTile make_tile);
  /// Takes samples that exist already, followed by kFieldLevelPadding zeros.
  LevelSamples(const SampleExtent& extent, std::vector<std::uint16_t> samples);

  /// kFieldLevelPadding more than the samples.
  [[nodiscard]] std::size_t size() const { return samples_.size(); }
  /// Makes the samples of `u_count` times `v_count` viewpoints from (u, v) on, and returns the
  /// first. Throws what their making throws.
  const std::uint16_t* viewpoints(int u, int v, int u_count = 1, int v_count = 1) const;
  /// Makes all samples, and returns them with the padding.
  [[nodiscard]] std::span<const std::uint16_t> view() const;

 private:
  [[nodiscard]] std::uint32_t& maker_of(int a, int b) const;
  void require_tile(int a, int b) const;

  SampleExtent extent_;
  SampleMemory memory_;
  std::span<std::uint16_t> samples_;
  std::span<std::uint32_t> makers_;  ///< who makes, or made, each tile
  std::shared_ptr<const MakeTile> make_tile_;
};

}  // namespace af
