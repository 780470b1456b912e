// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/field_build.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "precompute/casting/unit_tiles.h"
#include "precompute/codebook/mean_removal.h"
#include "ranks/values_of_ranks.h"
#include "ranks/work_queue.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Units that no rank holds yet, the costly ones first. The list is the same everywhere.
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

/// Takes in units while they are made: training candidates, counts, and tiles while they fit.
class TileKeeper {
 public:
  TileKeeper(const FieldBuild& build, std::uint64_t kept_tile_bytes, CastPhase& cast)
      : build_(build), bytes_left_(kept_tile_bytes), cast_(cast) {}

  void add(UnitTiles tiles) {
    cast_.picker.add(tiles, build_.units[tiles.unit_id]);
    cast_.tiles_per_unit[tiles.unit_id] = tiles.tiles.size();
    const std::uint64_t bytes = tiles.memory_bytes();
    if (bytes <= bytes_left_) {
      bytes_left_ -= bytes;
      cast_.kept.push_back(std::move(tiles));
    } else {
      cast_.dropped.push_back(tiles.unit_id);
    }
  }

 private:
  const FieldBuild& build_;
  std::uint64_t bytes_left_;
  CastPhase& cast_;
};

void require_all(const FieldBuild& build, std::uint64_t finished) {
  if (finished == build.units.size()) return;
  all_or_none(build.communicator, [&] {
    throw StoppedError("stopped with " + std::to_string(finished) + " of " +
                       std::to_string(build.units.size()) +
                       " units saved: run the same command again to go on");
  });
}

/// Collective. Turns this rank's numbers into those of all ranks.
void add_up(CastPhase& cast, double busy_seconds, const Communicator& communicator) {
  cast.rays_cast = sum_over(communicator, cast.rays_cast);
  cast.occupied_tiles_cast = sum_over(communicator, cast.occupied_tiles_cast);
  cast.units_kept = sum_over(communicator, cast.kept.size());
  cast.busy_seconds = from_all<double>({busy_seconds}, communicator);
  communicator.sum(cast.tiles_per_unit);
  cast.occupied_tiles =
      std::accumulate(cast.tiles_per_unit.begin(), cast.tiles_per_unit.end(), std::uint64_t{0});
}

}  // namespace

CastPhase cast_field(const FieldBuild& build,
                     const CastLimits& limits,
                     const StopRequested& stop_requested,
                     const ProgressCallback& on_progress) {
  const Communicator& communicator = build.communicator;
  CastPhase cast(TrainingTilePicker(limits.selection, build.lattice));
  cast.tiles_per_unit.assign(build.units.size(), 0);
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
    // After a stop request, the rest of the queue is drained without being cast.
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
  for (std::size_t i = 0; i < std::min(kUnitsRead, cast.dropped.size()); ++i)
    if (const auto tiles = build.progress->read(build.units[cast.dropped[i]]))
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
  // Every rank reaches the same conclusion. This makes it one error of the whole job.
  return all_or_none(build.communicator, [&] {
    TrainingShare share = cast.picker.take(reduction);
    remove_means(share, options.mean_step);
    return train_codebook(share, options, reduction, on_progress, checkpoints);
  });
}

FittedFilter fit_filter(const FieldBuild& build, const Codebook& codebook, std::uint64_t seed) {
  FilterSums sums = all_or_none(build.communicator, [&] {
    FilterSums mine(codebook);
    const std::vector<WorkUnit> patches = filter_patches(build.lattice, seed);
    const auto ranks = static_cast<std::size_t>(build.communicator.size());
    std::vector<std::uint16_t> samples;
    for (auto i = static_cast<std::size_t>(build.communicator.rank()); i < patches.size();
         i += ranks) {
      const WorkUnit& patch = patches[i];
      samples.resize(patch.sample_count());
      build.caster.cast(patch, samples);
      mine.add(patch, build.lattice.slabs[patch.slab], make_unit_tiles(patch, samples));
    }
    return mine;
  });
  build.communicator.sum(sums.values());
  return sums.fit();
}

}  // namespace af
