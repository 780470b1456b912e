// SPDX-License-Identifier: Apache-2.0
#include "drr/level_samples.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <limits>
#include <new>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/fork_aware_mutex.h"

namespace af {

namespace {

/// Stands for no process. Otherwise the fork_generation() of the process that makes a tile, plus
/// one.
constexpr std::uint32_t kNobody = 0;
constexpr std::uint32_t kMade = std::numeric_limits<std::uint32_t>::max();
constexpr std::chrono::microseconds kWait{50};

int tiles_of(int nodes) {
  return (nodes + 1) / 2;
}

}  // namespace

FieldLevelMemory process_memory() {
  return [](std::size_t bytes) {
    const std::shared_ptr<std::byte> memory(
        static_cast<std::byte*>(std::calloc(std::max<std::size_t>(bytes, 1), 1)), std::free);
    if (!memory) throw std::bad_alloc();
    return SampleMemory{memory};
  };
}

LevelSamples::LevelSamples(const SampleExtent& extent,
                           const FieldLevelMemory& memory,
                           MakeTile make_tile)
    : extent_(extent), make_tile_(std::make_shared<const MakeTile>(std::move(make_tile))) {
  const auto count = [](int nodes) { return static_cast<std::size_t>(nodes); };
  const std::size_t tiles = count(tiles_of(extent.u_nodes)) * count(tiles_of(extent.v_nodes));
  const std::size_t samples =
      count(extent.u_nodes) * count(extent.v_nodes) * extent.per_viewpoint + kFieldLevelPadding;
  constexpr std::size_t kPerMaker = sizeof(std::uint32_t) / sizeof(std::uint16_t);
  const std::size_t first_maker = (samples + kPerMaker - 1) / kPerMaker;
  memory_ = memory((first_maker + tiles) * sizeof(std::uint32_t));
  auto* const makers = reinterpret_cast<std::uint32_t*>(memory_.bytes.get());
  samples_ = {reinterpret_cast<std::uint16_t*>(makers), samples};
  makers_ = {makers + first_maker, tiles};
}

LevelSamples::LevelSamples(const SampleExtent& extent, std::vector<std::uint16_t> samples)
    : LevelSamples(extent, process_memory(), nullptr) {
  check(samples.size() == samples_.size(), "a sample per node of every viewpoint, and the padding");
  std::ranges::copy(samples, samples_.begin());
  std::ranges::fill(makers_, kMade);
}

const std::uint16_t* LevelSamples::viewpoints(int u, int v, int u_count, int v_count) const {
  for (int a = u / 2; a <= (u + u_count - 1) / 2; ++a)
    for (int b = v / 2; b <= (v + v_count - 1) / 2; ++b)
      if (std::atomic_ref(maker_of(a, b)).load(std::memory_order_acquire) != kMade)
        require_tile(a, b);
  return samples_.data() +
         static_cast<std::size_t>(u * extent_.v_nodes + v) * extent_.per_viewpoint;
}

std::span<const std::uint16_t> LevelSamples::view() const {
  viewpoints(0, 0, extent_.u_nodes, extent_.v_nodes);
  return samples_;
}

std::uint32_t& LevelSamples::maker_of(int a, int b) const {
  return makers_[static_cast<std::size_t>(a * tiles_of(extent_.v_nodes) + b)];
}

void LevelSamples::require_tile(int a, int b) const {
  const std::atomic_ref maker(maker_of(a, b));
  const std::uint32_t self = fork_generation() + 1;
  std::uint32_t seen = kNobody;
  while (!maker.compare_exchange_strong(seen, self)) {
    if (seen == kMade) return;
    // A process that was forked while its parent made the tile has a copy that nobody continues.
    if (!memory_.is_of_processes && seen != self) continue;
    std::this_thread::sleep_for(kWait);
    seen = kNobody;
  }
  try {
    (*make_tile_)(a, b, samples_);
  } catch (...) {
    maker.store(kNobody);
    throw;
  }
  maker.store(kMade, std::memory_order_release);
}

}  // namespace af
