// SPDX-License-Identifier: Apache-2.0
#include "precompute/pipeline/field_build.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <functional>
#include <numeric>
#include <queue>
#include <utility>

#include "base/crc32c.h"
#include "base/error.h"
#include "parallel/work_queue.h"
#include "parallel/work_watch.h"
#include "precompute/codebook/field_encoder.h"

namespace af {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

CodebookReduction reduction_over(const Communicator& communicator) {
  return {
      [&communicator](std::span<std::uint64_t> values) { communicator.sum(values); },
      [&communicator](std::span<const std::byte> mine) { return communicator.all_gather(mine); },
      static_cast<std::size_t>(communicator.rank())};
}

std::uint64_t sum_over(const Communicator& communicator, std::uint64_t value) {
  std::array<std::uint64_t, 1> total{value};
  communicator.sum(total);
  return total[0];
}

/// Units that no rank holds yet, the costly ones first; the same list everywhere.
std::vector<std::uint32_t> missing_units(const FieldBuild& build,
                                         const std::vector<std::uint64_t>& is_finished) {
  std::vector<std::uint64_t> holders = is_finished;
  build.communicator.sum(holders);
  std::vector<std::uint32_t> missing;
  for (std::uint32_t id = 0; id < holders.size(); ++id)
    if (holders[id] == 0) missing.push_back(id);
  if (!build.unit_costs.empty())
    std::stable_sort(missing.begin(), missing.end(), [&](std::uint32_t a, std::uint32_t b) {
      return build.unit_costs[a] > build.unit_costs[b];
    });
  return missing;
}

/// Takes units in while they are made: training candidates, counts, and tiles while they fit.
class TileKeeper {
 public:
  TileKeeper(const FieldBuild& build, std::uint64_t kept_tile_bytes, CastPhase& cast)
      : build_(build), bytes_left_(kept_tile_bytes), cast_(cast) {}

  void add(UnitTiles tiles) {
    cast_.picker.add(tiles, build_.units[tiles.unit_id]);
    cast_.unit_tiles[tiles.unit_id] = tiles.tiles.size();
    const std::uint64_t bytes = tiles.memory_bytes();
    if (bytes <= bytes_left_) {
      bytes_left_ -= bytes;
      cast_.kept.push_back(std::move(tiles));
    } else {
      cast_.let_go.push_back(tiles.unit_id);
    }
  }

 private:
  const FieldBuild& build_;
  std::uint64_t bytes_left_;
  CastPhase& cast_;
};

/// "unit 3 of 32 (slab 0, viewpoints u 0 to 7, v 2 to 3)".
std::string name_of(const WorkUnit& unit, std::size_t units) {
  const auto range = [](const NodeRange& nodes) {
    return std::to_string(nodes.begin) + " to " + std::to_string(nodes.end() - 1);
  };
  return "unit " + std::to_string(unit.id) + " of " + std::to_string(units) + " (slab " +
         std::to_string(unit.slab) + ", viewpoints u " + range(unit.u) + ", v " + range(unit.v) +
         ")";
}

void require_all(const FieldBuild& build, std::uint64_t finished) {
  if (finished == build.units.size()) return;
  all_or_none(build.communicator, [&] {
    throw StoppedError("stopped with " + std::to_string(finished) + " of " +
                       std::to_string(build.units.size()) +
                       " units saved: run the same command again to go on");
  });
}

/// Collective. From this rank's numbers to those of all ranks.
void add_up(CastPhase& cast, double busy_seconds, const Communicator& communicator) {
  cast.rays_cast = sum_over(communicator, cast.rays_cast);
  cast.occupied_tiles_cast = sum_over(communicator, cast.occupied_tiles_cast);
  cast.units_kept = sum_over(communicator, cast.kept.size());
  cast.busy_seconds = from_all<double>({busy_seconds}, communicator);
  communicator.sum(cast.unit_tiles);
  cast.occupied_tiles =
      std::accumulate(cast.unit_tiles.begin(), cast.unit_tiles.end(), std::uint64_t{0});
}

/// Deals out the units that nobody has kept, large ones first, each to the rank with the least to
/// do. `loads` are the tiles kept by each rank on entry, all tiles dealt to it on return.
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
    // A unit without tiles costs a little, too.
    least.emplace(loads[rank] = load + unit_tiles[id] + 1, rank);
  }
  return owners;
}

}  // namespace

CastPhase cast_field(const FieldBuild& build,
                     const CastLimits& limits,
                     const StopRequested& stop_requested,
                     const ProgressCallback& on_progress) {
  const Communicator& communicator = build.communicator;
  CastPhase cast(TrainingTilePicker(limits.selection, build.lattice));
  cast.unit_tiles.assign(build.units.size(), 0);
  TileKeeper keeper(build, limits.kept_tile_bytes, cast);
  std::vector<std::uint64_t> is_finished(build.units.size(), 0);
  if (build.progress != nullptr) {
    const WorkNote note("reading finished units from " + build.progress->path().string());
    build.progress->visit_finished(build.units, [&](UnitTiles tiles) {
      note_progress();
      is_finished[tiles.unit_id] = 1;
      keeper.add(std::move(tiles));
    });
  }
  const std::uint64_t resumed =
      static_cast<std::uint64_t>(std::count(is_finished.begin(), is_finished.end(), 1));
  cast.units_resumed = sum_over(communicator, resumed);
  const auto missing = missing_units(build, is_finished);
  std::uint64_t finished = 0;
  double busy_seconds = 0.0;
  std::vector<std::uint16_t> samples;
  const auto work = [&](std::int64_t item) {
    // After a stop request the rest of the queue is drained without being cast.
    if (stop_requested()) return;
    const auto start = Clock::now();
    const WorkUnit& unit = build.units[missing[static_cast<std::size_t>(item)]];
    const WorkNote note("casting " + name_of(unit, build.units.size()));
    samples.resize(unit.sample_count());
    build.caster.cast(unit, samples);
    UnitTiles tiles = make_unit_tiles(unit, samples);
    if (build.progress != nullptr) build.progress->append(tiles);
    cast.rays_cast += unit.sample_count();
    cast.occupied_tiles_cast += tiles.tiles.size();
    keeper.add(std::move(tiles));
    ++finished;
    busy_seconds += seconds_since(start);
  };
  for_each_item(
      communicator, static_cast<std::int64_t>(missing.size()), work, [&](std::int64_t done) {
        if (on_progress)
          on_progress(static_cast<double>(done), static_cast<double>(missing.size()));
      });
  all_or_none(communicator, [&] {
    if (build.progress != nullptr) build.progress->sync();
  });
  require_all(build, cast.units_resumed + sum_over(communicator, finished));
  add_up(cast, busy_seconds, communicator);
  return cast;
}

OverflowChoice choose_overflow(const FieldBuild& build, const CastPhase& cast) {
  const double cast_seconds =
      std::accumulate(cast.busy_seconds.begin(), cast.busy_seconds.end(), 0.0);
  OverflowChoice choice;
  if (cast_seconds > 0.0)
    choice.cast_bytes_per_second =
        static_cast<double>(cast.occupied_tiles_cast * sizeof(Tile)) / cast_seconds;
  if (build.progress == nullptr) return choice;
  constexpr std::size_t kUnitsRead = 4;
  build.progress->forget_cached();
  build.communicator.barrier();
  const auto start = Clock::now();
  std::uint64_t bytes = 0;
  for (std::size_t i = 0; i < std::min(kUnitsRead, cast.let_go.size()); ++i)
    if (const auto tiles = build.progress->read(build.units[cast.let_go[i]]))
      bytes += tiles->memory_bytes();
  const auto seconds =
      from_all<double>({bytes > 0 ? seconds_since(start) : 0.0}, build.communicator);
  const double read_seconds = std::accumulate(seconds.begin(), seconds.end(), 0.0);
  bytes = sum_over(build.communicator, bytes);
  if (read_seconds > 0.0) choice.read_bytes_per_second = static_cast<double>(bytes) / read_seconds;
  if (choice.read_bytes_per_second >= choice.cast_bytes_per_second)
    choice.overflow = TileOverflow::ReadBack;
  return choice;
}

TrainedCodebook train_field(const FieldBuild& build,
                            CastPhase& cast,
                            const CodebookOptions& options,
                            const ProgressCallback& on_progress,
                            const TrainingCheckpoints& checkpoints) {
  const CodebookReduction reduction = reduction_over(build.communicator);
  // Every rank comes to the same conclusion; this makes it one error of the whole job.
  return all_or_none(build.communicator, [&] {
    TrainingShare share = cast.picker.take(reduction);
    level_out(share, reduction);
    return train_codebook(share, options, reduction, on_progress, checkpoints);
  });
}

namespace {

/// A record's checksum says that it is whole, not that it is ours.
bool are_below(const std::vector<std::uint16_t>& indices, std::size_t count) {
  return std::all_of(
      indices.begin(), indices.end(), [&](std::uint16_t index) { return index < count; });
}

}  // namespace

FieldEncoder::FieldEncoder(const FieldBuild& build,
                           CastPhase& cast,
                           const Codebook& codebook,
                           TileOverflow overflow)
    : build_(build),
      cast_(cast),
      search_(codebook),
      codebook_crc_(crc32c(std::as_bytes(std::span(codebook.codewords)))),
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
  const auto owners = balanced_owners(cast_.unit_tiles, is_kept, loads);
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
  busy_seconds_ += seconds_since(start);
  return blocks;
}

IndexBlock FieldEncoder::next_block() {
  const bool is_kept = !cast_.kept.empty();
  const WorkUnit& unit = build_.units[is_kept ? cast_.kept.back().unit_id : others_.back()];
  const WorkNote note("encoding " + name_of(unit, build_.units.size()));
  EncodedUnit of_unit = encoded(unit, is_kept);
  if (is_kept)
    cast_.kept.pop_back();
  else
    others_.pop_back();
  tiles_done_ += static_cast<double>(cast_.unit_tiles[unit.id]);
  squared_error_ += of_unit.squared_error;
  return {unit.slab,
          TilePlaces(build_.lattice, unit).first(),
          unit.tile_counts(),
          std::move(of_unit.indices)};
}

EncodedUnit FieldEncoder::encoded(const WorkUnit& unit, bool is_kept) {
  if (build_.progress != nullptr)
    if (auto before = build_.progress->read_encoded(unit, codebook_crc_);
        before && are_below(before->indices, search_.codeword_count())) {
      ++units_resumed_;
      return std::move(*before);
    }
  EncodedUnit of_unit = is_kept ? encode_unit(search_, unit, cast_.kept.back())
                                : encode_unit(search_, unit, tiles_again(unit));
  if (build_.progress != nullptr) build_.progress->append(unit, of_unit, codebook_crc_);
  return of_unit;
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
