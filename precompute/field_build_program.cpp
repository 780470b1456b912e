// SPDX-License-Identifier: Apache-2.0
#include "precompute/field_build_program.h"

#include <array>
#include <cstring>

#include "base/error.h"
#include "parallel/work_queue.h"
#include "precompute/field_encoder.h"
#include "precompute/planner.h"

namespace af {

namespace {

CodebookReduction reduction_over(const Communicator& communicator) {
  return {
      [&communicator](std::span<std::uint64_t> values) { communicator.sum(values); },
      [&communicator](std::span<const std::byte> mine) { return communicator.all_gather(mine); }};
}

std::uint64_t sum_over(const Communicator& communicator, std::uint64_t value) {
  std::array<std::uint64_t, 1> total{value};
  communicator.sum(total);
  return total[0];
}

/// Units that no rank holds yet, the same list everywhere.
std::vector<std::uint32_t> missing_units(const std::vector<UnitTiles>& mine,
                                         std::size_t unit_count,
                                         const Communicator& communicator) {
  std::vector<std::uint64_t> holders(unit_count, 0);
  for (const UnitTiles& tiles : mine) ++holders[tiles.unit_id];
  communicator.sum(holders);
  std::vector<std::uint32_t> missing;
  for (std::uint32_t id = 0; id < unit_count; ++id)
    if (holders[id] == 0) missing.push_back(id);
  return missing;
}

std::array<int, 4> first_tile_of(const WorkUnit& unit, const LightSlab& light_slab) {
  const SlabGeometry& slab = light_slab.slabs[unit.slab];
  return {unit.u.begin / 2,
          unit.v.begin / 2,
          (unit.s.begin - slab.stored_s.begin) / 2,
          (unit.t.begin - slab.stored_t.begin) / 2};
}

void append_axis(const GridAxis& axis, std::vector<double>& numbers) {
  numbers.insert(numbers.end(), {axis.first_mm, axis.last_mm, static_cast<double>(axis.nodes)});
}

/// Takes numbers one after the other.
class NumberReader {
 public:
  explicit NumberReader(std::span<const double> numbers) : numbers_(numbers) {}
  double next() { return numbers_[position_++]; }
  int next_int() { return static_cast<int>(next()); }
  GridAxis next_axis() {
    const double first = next();
    const double last = next();
    return {first, last, next_int()};
  }
  NodeRange next_range() {
    const int begin = next_int();
    return {begin, next_int()};
  }

 private:
  std::span<const double> numbers_;
  std::size_t position_ = 0;
};

std::vector<double> numbers_of(const LightSlab& light_slab) {
  const auto& matrix = light_slab.slab_from_ct.matrix();
  std::vector<double> numbers(matrix.data(), matrix.data() + matrix.size());
  numbers.push_back(light_slab.uv_plane_y_mm);
  append_axis(light_slab.u, numbers);
  append_axis(light_slab.v, numbers);
  for (const SlabGeometry& slab : light_slab.slabs) {
    numbers.insert(numbers.end(), {slab.st_plane_y_mm, slab.y_low_mm, slab.y_high_mm});
    append_axis(slab.s, numbers);
    append_axis(slab.t, numbers);
    for (const NodeRange& range : {slab.stored_s, slab.stored_t})
      numbers.insert(numbers.end(),
                     {static_cast<double>(range.begin), static_cast<double>(range.count)});
  }
  return numbers;
}

LightSlab light_slab_of(std::span<const double> numbers, std::size_t slabs) {
  NumberReader reader(numbers);
  LightSlab light_slab;
  for (Eigen::Index i = 0; i < 16; ++i) light_slab.slab_from_ct.matrix().data()[i] = reader.next();
  light_slab.uv_plane_y_mm = reader.next();
  light_slab.u = reader.next_axis();
  light_slab.v = reader.next_axis();
  for (std::size_t k = 0; k < slabs; ++k) {
    SlabGeometry slab;
    slab.st_plane_y_mm = reader.next();
    slab.y_low_mm = reader.next();
    slab.y_high_mm = reader.next();
    slab.s = reader.next_axis();
    slab.t = reader.next_axis();
    slab.stored_s = reader.next_range();
    slab.stored_t = reader.next_range();
    light_slab.slabs.push_back(slab);
  }
  return light_slab;
}

}  // namespace

CastPhase cast_field(const FieldCaster& caster,
                     const std::vector<WorkUnit>& units,
                     ProgressFolder* progress,
                     const StopRequested& stop_requested,
                     const ProgressCallback& on_progress,
                     const Communicator& communicator) {
  CastPhase cast;
  if (progress != nullptr) cast.mine = progress->read_finished(units);
  cast.units_resumed = sum_over(communicator, cast.mine.size());
  const auto missing = missing_units(cast.mine, units.size(), communicator);
  std::uint64_t finished = 0;
  std::vector<std::uint16_t> samples;
  const auto work = [&](std::int64_t item) {
    // After a stop request the rest of the queue is drained without being cast.
    if (stop_requested()) return;
    const WorkUnit& unit = units[missing[static_cast<std::size_t>(item)]];
    samples.resize(unit.sample_count());
    caster.cast(unit, samples);
    cast.mine.push_back(make_unit_tiles(unit, samples));
    if (progress != nullptr) progress->append(cast.mine.back());
    cast.rays_cast += unit.sample_count();
    ++finished;
  };
  for_each_item(
      communicator, static_cast<std::int64_t>(missing.size()), work, [&](std::int64_t done) {
        if (on_progress)
          on_progress(static_cast<double>(done), static_cast<double>(missing.size()));
      });
  all_or_none(communicator, [&] {
    if (progress != nullptr) progress->sync();
  });
  const std::uint64_t all_finished = sum_over(communicator, finished);
  if (all_finished < missing.size())
    all_or_none(communicator, [&] {
      throw StoppedError("stopped with " + std::to_string(cast.units_resumed + all_finished) +
                         " of " + std::to_string(units.size()) +
                         " units saved: run the same command again to go on");
    });
  cast.rays_cast = sum_over(communicator, cast.rays_cast);
  for (const UnitTiles& tiles : cast.mine) cast.occupied_tiles += tiles.tiles.size();
  cast.occupied_tiles = sum_over(communicator, cast.occupied_tiles);
  return cast;
}

TrainedCodebook train_field(const CastPhase& cast,
                            const std::vector<WorkUnit>& units,
                            const LightSlab& light_slab,
                            const TrainingSelection& selection,
                            const CodebookOptions& options,
                            const ProgressCallback& on_progress,
                            const Communicator& communicator) {
  const CodebookReduction reduction = reduction_over(communicator);
  // Every rank comes to the same conclusion; this makes it one error of the whole job.
  return all_or_none(communicator, [&] {
    const TrainingShare share =
        select_training_tiles(cast.mine, units, light_slab, selection, reduction);
    return train_codebook(share, options, reduction, on_progress);
  });
}

EncodePhase encode_field(CastPhase& cast,
                         const std::vector<WorkUnit>& units,
                         const LightSlab& light_slab,
                         const Codebook& codebook,
                         const ProgressCallback& on_progress,
                         const Communicator& communicator) {
  const NearestCodeword search(codebook);
  EncodePhase encoded;
  double done = 0.0;
  for (UnitTiles& tiles : cast.mine) {
    const WorkUnit& unit = units[tiles.unit_id];
    EncodedUnit of_unit = encode_unit(search, unit, tiles);
    encoded.squared_error += of_unit.squared_error;
    encoded.blocks.push_back({unit.slab,
                              first_tile_of(unit, light_slab),
                              unit.tile_counts(),
                              std::move(of_unit.indices)});
    tiles = UnitTiles{};
    done += 1.0;
    if (on_progress) on_progress(done, static_cast<double>(cast.mine.size()));
  }
  cast.mine.clear();
  encoded.squared_error = sum_over(communicator, encoded.squared_error);
  return encoded;
}

LightSlab shared_light_slab(const LightSlab& light_slab, const Communicator& communicator) {
  std::vector<double> numbers = numbers_of(light_slab);
  const auto raw = std::as_bytes(std::span(numbers));
  std::vector<std::byte> bytes(raw.begin(), raw.end());
  communicator.broadcast(bytes);
  numbers.resize(bytes.size() / sizeof(double));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  return light_slab_of(numbers, light_slab.slabs.size());
}

}  // namespace af
