// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/speed_sample.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fcntl.h>
#include <numeric>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/hash_random.h"
#include "precompute/casting/unit_tiles.h"
#include "precompute/codebook/mean_removal.h"
#include "precompute/codebook/nearest_codeword.h"
#include "precompute/design/packed_bytes.h"

namespace af {

namespace {

constexpr std::uint64_t kSampleSeed = 1;

class Stopwatch {
 public:
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Units in an order that depends only on their number.
std::vector<std::size_t> shuffled(std::size_t count) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [](std::size_t a, std::size_t b) {
    return hash64(kSampleSeed, a) < hash64(kSampleSeed, b);
  });
  return order;
}

/// Tiles of sampled units: one run of neighbours to encode, and others, spread over all units, from
/// which codewords are drawn.
struct SampledTiles {
  std::vector<Tile> run;
  std::vector<Tile> spread;

  void add(const std::vector<Tile>& tiles) {
    constexpr std::size_t kRun = 2000;
    const std::size_t first = tiles.size() > kRun ? (tiles.size() - kRun) / 2 : 0;
    const std::size_t end = std::min(tiles.size(), first + kRun);
    run.insert(run.end(),
               tiles.begin() + static_cast<std::ptrdiff_t>(first),
               tiles.begin() + static_cast<std::ptrdiff_t>(end));
    constexpr std::size_t kStride = 7;
    for (std::size_t i = 0; i < tiles.size(); i += kStride)
      if (i < first || i >= end) spread.push_back(tiles[i]);
  }
};

/// Every n-th of the spread tiles, or folded shapes where `mean_step` is above 0. n is chosen to
/// give the requested number, if there are enough.
Codebook drawn_codebook(std::vector<Tile> tiles, int codewords, int mean_step) {
  std::vector<Tile> drawn{Tile{}};
  const std::size_t wanted = static_cast<std::size_t>(codewords) - 1;
  std::sort(tiles.begin(), tiles.end());
  tiles.erase(std::unique(tiles.begin(), tiles.end()), tiles.end());
  const std::size_t count = std::min(wanted, tiles.size());
  for (std::size_t i = 0; i < count; ++i) drawn.push_back(tiles[i * tiles.size() / count]);
  std::sort(drawn.begin(), drawn.end(), codeword_less);
  return codebook_of_searched(std::move(drawn), mean_step);
}

void sample_search(SampledTiles tiles, const PrecomputeOptions& options, SpeedSample& sample) {
  if (tiles.run.empty() || tiles.spread.empty()) return;
  const int mean_step = options.design().mean_step;
  std::vector<std::uint16_t> means;
  if (mean_step > 0) {
    for (Tile& tile : tiles.spread) tile = remove_mean(tile, mean_step).shape;
    for (Tile& tile : tiles.run) {
      const MeanRemovedTile removed = remove_mean(tile, mean_step);
      means.push_back(removed.mean);
      tile = removed.shape;
    }
  }
  const Codebook codebook = drawn_codebook(tiles.spread, options.design().codewords, mean_step);
  const Stopwatch preparing;
  const NearestCodeword search(codebook);
  sample.codebook_seconds = preparing.seconds();
  std::vector<std::uint32_t> nearest(tiles.run.size());
  std::vector<std::uint64_t> errors(tiles.run.size());
  const auto seconds_per_tile = [&](SearchHint hint) {
    const Stopwatch watch;
    search.search(tiles.run, hint, nearest, errors);
    return watch.seconds() / static_cast<double>(tiles.run.size());
  };
  sample.encode_seconds_per_tile = seconds_per_tile(SearchHint::None);
  sample.train_seconds_per_tile = seconds_per_tile(SearchHint::PerTile);
  std::vector<std::uint16_t> indices(nearest.begin(), nearest.end());
  indices.insert(indices.end(), means.begin(), means.end());
  const Stopwatch packing;
  const auto packed =
      static_cast<double>(packed_bytes(indices, nearest.size(), /*has_means=*/mean_step > 0));
  const auto bytes = 2.0 * static_cast<double>(indices.size());
  sample.compress_seconds_per_byte = packing.seconds() / bytes;
  sample.compressed_fraction = packed / bytes;
}

}  // namespace

SpeedSample sample_speed(const FieldCaster& caster,
                         const FieldLattice& lattice,
                         const PlanOptions& plan,
                         const PrecomputeOptions& options,
                         double seconds) {
  const auto units = plan_units(lattice, plan);
  double elapsed = 0.0;
  std::size_t rays = 0;
  std::size_t tiles = 0;
  std::size_t occupied = 0;
  SampledTiles sampled;
  std::vector<std::uint16_t> samples;
  for (const std::size_t i : shuffled(units.size())) {
    if (elapsed >= seconds) break;
    const WorkUnit& unit = units[i];
    const Stopwatch watch;
    samples.resize(unit.sample_count());
    caster.cast(unit, samples);
    const UnitTiles of_unit = make_unit_tiles(unit, samples);
    elapsed += watch.seconds();
    rays += samples.size();
    tiles += unit.tile_count();
    occupied += of_unit.tiles.size();
    sampled.add(of_unit.tiles);
  }
  SpeedSample sample;
  sample.rays_per_second = static_cast<double>(rays) / std::max(elapsed, 1e-9);
  sample.occupied_fraction = static_cast<double>(occupied) / static_cast<double>(tiles);
  sample_search(sampled, options, sample);
  return sample;
}

DiskSample sample_disk(const std::filesystem::path& folder) {
  constexpr std::size_t kBytes = std::size_t{16} << 20;
  std::string name = (folder / ".af-disk-XXXXXX").string();
  const int descriptor = ::mkstemp(name.data());
  if (descriptor < 0) return {};
  ::unlink(name.c_str());
  std::vector<std::uint64_t> noise(kBytes / sizeof(std::uint64_t));
  for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = hash64(kSampleSeed, i);
  DiskSample sample;
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  if (!error) sample.available_bytes = space.available;
  const Stopwatch writing;
  bool is_good = ::write(descriptor, noise.data(), kBytes) == static_cast<ssize_t>(kBytes) &&
                 ::fsync(descriptor) == 0;
  if (is_good) sample.write_bytes_per_second = static_cast<double>(kBytes) / writing.seconds();
  ::posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED);
  const Stopwatch reading;
  is_good = is_good && ::pread(descriptor, noise.data(), kBytes, 0) == static_cast<ssize_t>(kBytes);
  if (is_good) sample.read_bytes_per_second = static_cast<double>(kBytes) / reading.seconds();
  ::close(descriptor);
  return sample;
}

}  // namespace af
