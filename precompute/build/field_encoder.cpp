// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/field_encoder.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <numeric>
#include <queue>
#include <span>
#include <utility>

#include "base/crc32c.h"
#include "base/error.h"
#include "precompute/casting/unit_planner.h"
#include "ranks/values_of_ranks.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

static_assert(kLargestS % (2 * kIndexChunkTiles[0]) == 0 && kLargestT == 2 * kIndexChunkTiles[1],
              "a unit that is not cut is whole chunks of a field file");
static_assert(kRunOfT == 2 * kMeanRunTiles, "units begin where differences of means do");

using Clock = std::chrono::steady_clock;

/// Deals out the units that nobody has kept, large ones first, each to the rank with the least to
/// do. `loads` holds the tiles that each rank kept on entry, and all tiles dealt to it on return.
std::vector<std::size_t> balanced_owners(const std::vector<std::uint64_t>& unit_tiles,
                                         const std::vector<std::uint64_t>& is_kept,
                                         std::vector<std::uint64_t>& loads) {
  std::vector<std::uint32_t> others;
  for (std::uint32_t id = 0; id < unit_tiles.size(); ++id)
    if (is_kept[id] == 0) others.push_back(id);
  std::stable_sort(others.begin(), others.end(), [&](std::uint32_t a, std::uint32_t b) {
    return unit_tiles[a] > unit_tiles[b];
  });
  using Load = std::pair<std::uint64_t, std::size_t>;
  std::priority_queue<Load, std::vector<Load>, std::greater<>> least;
  for (std::size_t rank = 0; rank < loads.size(); ++rank) least.emplace(loads[rank], rank);
  std::vector<std::size_t> owners(unit_tiles.size(), loads.size());
  for (const std::uint32_t id : others) {
    auto [load, rank] = least.top();
    least.pop();
    owners[id] = rank;
    // A unit without tiles also costs a little.
    least.emplace(loads[rank] = load + unit_tiles[id] + 1, rank);
  }
  return owners;
}

/// Checksum over the codewords as they are searched.
std::uint32_t crc_of(const Codebook& codebook) {
  const std::vector<Tile> codewords = searched_codewords(codebook);
  const std::uint32_t crc = crc32c(std::as_bytes(std::span(codewords)));
  return crc ^ static_cast<std::uint32_t>(codebook.mean_step);
}

}  // namespace

FieldEncoder::FieldEncoder(const FieldBuild& build,
                           CastPhase& cast,
                           const Codebook& codebook,
                           TileOverflow overflow)
    : build_(build),
      cast_(cast),
      codebook_(codebook),
      search_(codebook),
      codebook_crc_(crc_of(codebook)),
      overflow_(overflow) {
  if (build_.progress != nullptr && overflow_ == TileOverflow::ReadBack)
    build_.progress->share_places();
  deal_out_others();
}

void FieldEncoder::deal_out_others() {
  const auto ranks = static_cast<std::size_t>(build_.communicator.size());
  const auto mine = static_cast<std::size_t>(build_.communicator.rank());
  std::vector<std::uint64_t> loads(ranks, 0);
  std::vector<std::uint64_t> is_kept(build_.units.size(), 0);
  for (const UnitTiles& tiles : cast_.kept) {
    is_kept[tiles.unit_id] = 1;
    loads[mine] += tiles.tiles.size();
  }
  build_.communicator.sum(loads);
  build_.communicator.sum(is_kept);
  const auto owners = balanced_owners(cast_.tiles_per_unit, is_kept, loads);
  for (std::uint32_t id = 0; id < owners.size(); ++id)
    if (is_kept[id] == 0 && owners[id] == mine) others_.push_back(id);
  tiles_in_all_ = static_cast<double>(loads[mine]);
}

std::vector<IndexBlock> FieldEncoder::next_blocks(const ProgressCallback& on_progress,
                                                  const StopRequested& stop_requested) {
  const auto start = Clock::now();
  std::vector<IndexBlock> blocks;
  std::size_t bytes = 0;
  while (bytes < kRoundBytes && !(cast_.kept.empty() && others_.empty())) {
    if (stop_requested && stop_requested()) {
      if (build_.progress != nullptr) build_.progress->sync();
      throw StoppedError(
          "stopped while encoding with all finished units saved: run the same command again to go "
          "on");
    }
    blocks.push_back(next_block());
    bytes += blocks.back().indices.size() * sizeof(std::uint16_t);
    if (on_progress) on_progress(tiles_done_, tiles_in_all_);
  }
  busy_seconds_ += std::chrono::duration<double>(Clock::now() - start).count();
  return blocks;
}

IndexBlock FieldEncoder::next_block() {
  const bool is_kept = !cast_.kept.empty();
  const WorkUnit& unit = build_.units[is_kept ? cast_.kept.back().unit_id : others_.back()];
  const WorkNote note("encoding " + name_of(unit, build_.units.size()));
  EncodedUnit of_unit = encoded(unit, is_kept ? &cast_.kept.back() : nullptr);
  if (is_kept)
    cast_.kept.pop_back();
  else
    others_.pop_back();
  tiles_done_ += static_cast<double>(cast_.tiles_per_unit[unit.id]);
  squared_error_ += of_unit.squared_error;
  return {unit.slab,
          TilePlaces(build_.lattice, unit).first(),
          unit.tile_counts(),
          std::move(of_unit.indices)};
}

EncodedUnit FieldEncoder::encoded(const WorkUnit& unit, const UnitTiles* kept) {
  if (build_.progress != nullptr)
    if (auto before =
            build_.progress->read_encoded(unit, codebook_.values_per_tile(), codebook_crc_);
        before && is_ours(*before, unit)) {
      ++units_resumed_;
      return std::move(*before);
    }
  const auto encode = [&](const UnitTiles& tiles) { return encode_unit(search_, unit, tiles); };
  EncodedUnit of_unit = kept != nullptr ? encode(*kept) : encode(tiles_again(unit));
  if (build_.progress != nullptr) build_.progress->append(unit, of_unit, codebook_crc_);
  return of_unit;
}

bool FieldEncoder::is_ours(const EncodedUnit& before, const WorkUnit& unit) const {
  const auto row = static_cast<std::size_t>(unit.tile_counts()[3]);
  return index_problems(before.indices, row, codebook_, "a unit").empty();
}

UnitTiles FieldEncoder::tiles_again(const WorkUnit& unit) {
  if (overflow_ == TileOverflow::ReadBack && build_.progress != nullptr) {
    if (auto tiles = build_.progress->read(unit)) return std::move(*tiles);
    ++units_damaged_;
  }
  samples_.resize(unit.sample_count());
  build_.caster.cast(unit, samples_);
  return make_unit_tiles(unit, samples_);
}

std::uint64_t FieldEncoder::squared_error() const {
  return sum_over(build_.communicator, squared_error_);
}

std::uint64_t FieldEncoder::units_resumed() const {
  return sum_over(build_.communicator, units_resumed_);
}

std::vector<double> FieldEncoder::busy_seconds() const {
  return from_all<double>({busy_seconds_}, build_.communicator);
}

}  // namespace af
