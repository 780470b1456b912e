// SPDX-License-Identifier: Apache-2.0
#include "precompute/dry_run.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "base/joined.h"
#include "precompute/build/field_build.h"
#include "precompute/build/memory_plan.h"
#include "precompute/build/speed_sample.h"
#include "precompute/casting/casters.h"
#include "precompute/design/quantisation_probe.h"
#include "precompute/formatted_text.h"
#include "ranks/root_only.h"

namespace af {

namespace {

/// What a forecast is made from.
struct DryRun {
  const SizedField& field;
  std::vector<WorkUnit> units;
  SpeedSample speed;  ///< of one rank
  DiskSample disk;    ///< of the folder that holds unfinished work
  MemoryPlan memory;
  PhaseSeconds past;  ///< phases that a dry run itself goes through: reading and resampling
  int ranks = 1;
};

/// What the field would need.
struct FieldForecast {
  std::uint64_t uncropped_bytes = 0;                ///< all nodes of the lattice at 16 bits
  std::uint64_t cropped_bytes = 0;                  ///< stored nodes at 16 bits
  std::uint64_t payload_bytes = 0;                  ///< indices and codebook
  std::uint64_t file_bytes = 0;                     ///< about: empty tiles compress away
  std::uint64_t tile_bytes = 0;                     ///< tiles that are not empty, over all ranks
  std::uint64_t kept_bytes = 0;                     ///< how many of them stay in memory
  TileOverflow overflow = TileOverflow::CastAgain;  ///< for the rest
  std::uint64_t limit_bytes = 0;                    ///< of memory, per rank
  std::uint64_t bytes_per_rank = 0;
  PhaseSeconds seconds;

  [[nodiscard]] double all_seconds() const {
    double all = 0.0;
    for (const auto& [phase, of_phase] : seconds) all += of_phase;
    return all;
  }
};

/// Tiles of a field, and how many are worked on.
struct TileCounts {
  double all = 0.0;
  double occupied = 0.0;
  double training = 0.0;  ///< including those held out

  TileCounts(const DryRun& run)
      : all(static_cast<double>(run.field.lattice.tile_count())),
        occupied(all * run.speed.occupied_fraction),
        training(training_tiles(run.field.options.training_selection())) {}

 private:
  [[nodiscard]] double training_tiles(const TrainingSelection& selection) const {
    return 1.125 * std::min(occupied * selection.fraction,
                            static_cast<double>(selection.max_training_tiles));
  }
};

/// Bytes of indices and, if there are any, means.
double bytes_per_tile(const PrecomputeOptions& options) {
  return options.design().mean_step > 0 ? 4.0 : 2.0;
}

double seconds_at(double amount, double per_second) {
  return per_second > 0.0 ? amount / per_second : 0.0;
}

void forecast_memory(const DryRun& run, const TileCounts& tiles, FieldForecast& need) {
  need.limit_bytes = memory_limit(run.field.options, run.memory);
  const std::uint64_t kept_per_rank = run.memory.kept_tile_bytes(need.limit_bytes);
  need.tile_bytes = static_cast<std::uint64_t>(sizeof(Tile) * tiles.occupied);
  need.kept_bytes =
      std::min(need.tile_bytes, kept_per_rank * static_cast<std::uint64_t>(run.ranks));
  need.bytes_per_rank =
      run.memory.least_bytes() + need.kept_bytes / static_cast<std::uint64_t>(run.ranks);
  // The same rule as in choose_overflow(): ranks share the disk, but not the casting.
  const double cast_bytes_per_second =
      2.0 * run.speed.rays_per_second * run.speed.occupied_fraction * run.ranks;
  if (run.field.options.has_checkpoint && run.disk.read_bytes_per_second >= cast_bytes_per_second)
    need.overflow = TileOverflow::ReadBack;
}

void forecast_seconds(const DryRun& run, const TileCounts& tiles, FieldForecast& need) {
  const SpeedSample& speed = run.speed;
  const auto tile_bytes = static_cast<double>(need.tile_bytes);
  const double cast_seconds = static_cast<double>(run.field.lattice.stored_node_count()) /
                              speed.rays_per_second / run.ranks;
  const double checkpoint_seconds = run.field.options.has_checkpoint
                                        ? seconds_at(tile_bytes, run.disk.write_bytes_per_second)
                                        : 0.0;
  // Most trainings end after about this many iterations.
  constexpr double kIterations = 10.0;
  const double overflow_fraction =
      tile_bytes > 0.0 ? 1.0 - static_cast<double>(need.kept_bytes) / tile_bytes : 0.0;
  const double overflow_seconds =
      need.overflow == TileOverflow::ReadBack
          ? seconds_at(overflow_fraction * tile_bytes, run.disk.read_bytes_per_second)
          : overflow_fraction * cast_seconds;
  const double index_bytes = bytes_per_tile(run.field.options) * tiles.occupied;
  const double compress_seconds = index_bytes * speed.compress_seconds_per_byte;
  // The file is read back. Decoding takes as long as coding, and SHA-256 some 2 ns per byte.
  const double verify_seconds =
      compress_seconds + 2e-9 * bytes_per_tile(run.field.options) * tiles.all;
  const double verifying_ranks =
      std::min(static_cast<double>(run.ranks), static_cast<double>(run.field.lattice.slabs.size()));
  need.seconds = run.past;
  need.seconds.emplace_back("cast", cast_seconds + checkpoint_seconds);
  need.seconds.emplace_back(
      "train",
      kIterations *
          (speed.codebook_seconds + speed.train_seconds_per_tile * tiles.training / run.ranks));
  need.seconds.emplace_back(
      "encode", speed.encode_seconds_per_tile * tiles.occupied / run.ranks + overflow_seconds);
  need.seconds.emplace_back(
      "write",
      compress_seconds / run.ranks + verify_seconds / verifying_ranks +
          seconds_at(static_cast<double>(need.file_bytes), run.disk.write_bytes_per_second));
}

std::string axis_text(const char* name, const GridAxis& first, const GridAxis& second) {
  return formatted("  %s plane        %.1f x %.1f mm, %d x %d nodes, %.2f x %.2f mm apart\n",
                   name,
                   first.last_mm - first.first_mm,
                   second.last_mm - second.first_mm,
                   first.nodes,
                   second.nodes,
                   first.spacing_mm(),
                   second.spacing_mm());
}

std::string planes_text(const LightSlab& planes) {
  std::string text = axis_text("(u,v)", planes.u, planes.v);
  for (const SlabGeometry& slab : planes.slabs) {
    text += axis_text("(s,t)", slab.s, slab.t);
    text += formatted("  stored part        s nodes %d to %d, t nodes %d to %d (%.0f %%)\n",
                      slab.stored_s.begin,
                      slab.stored_s.end() - 1,
                      slab.stored_t.begin,
                      slab.stored_t.end() - 1,
                      100.0 * slab.stored_s.count * slab.stored_t.count /
                          (static_cast<double>(slab.s.nodes) * slab.t.nodes));
  }
  return text;
}

/// Describes the members of an atlas.
std::string parts_text(const std::vector<FieldPart>& parts) {
  const std::string names =
      joined(parts, ", ", [](const FieldPart& part) { return part.source.camera.name; });
  return "  atlas              " + std::to_string(parts.size()) + " fields: " + names +
         "; each for at least " + parts.front().range.text() + "\n";
}

/// Says what other options would give.
std::string advice_text(const FieldPart& part, const PrecomputeOptions& options) {
  const FieldSource& source = part.source;
  const LightSlab& planes = part.light_slab;
  const SlabGeometry& slab = planes.slabs.front();
  const FieldLattice lattice = planes.lattice();
  std::string text = formatted(
      "Advice\n  Your range uses %.0f %% of the (s,t) plane; the rest holds no shadow of the CT "
      "and costs nothing.\n",
      100.0 * static_cast<double>(lattice.stored_node_count()) /
          static_cast<double>(lattice.node_count()));
  const MotionRange narrower(source.range.max_rotation_rad(),
                             0.5 * source.range.max_translation_mm());
  if (source.range.is_symmetric() && narrower.max_translation_mm() >= 5.0) {
    // The spacing that half the range would give with the same nodes.
    const LightSlab alternative =
        sized_planes(source, options, narrower, {{}, {slab.st_plane_y_mm}});
    text += formatted(
        "  With --max-translation-mm %.0f the same nodes would stand %.2f instead of %.2f mm apart "
        "on the (s,t) plane: sharper DRRs for the same size.\n",
        narrower.max_translation_mm(),
        alternative.slabs.front().s.spacing_mm(),
        slab.s.spacing_mm());
  }
  const double pixel_mm = source.camera.pixel_spacing_mm.minCoeff() *
                          source.camera.depth_mm(source.frame.center_room_mm) /
                          source.camera.source_detector_distance_mm();
  if (slab.s.spacing_mm() > 2.0 * pixel_mm)
    text += formatted(
        "  A pixel of %s is %.2f mm wide at the centre, the (s,t) nodes are %.2f mm apart: more "
        "--st-nodes buy more than more --uv-nodes.\n",
        source.camera.name.c_str(),
        pixel_mm,
        slab.s.spacing_mm());
  return text;
}

std::string memory_text(const DryRun& run, const FieldForecast& need) {
  std::string text = "  memory             " + megabytes_text(run.field.volume_bytes()) +
                     " per node for the CT and its grid, up to " +
                     megabytes_text(need.bytes_per_rank) + " per rank (limit " +
                     megabytes_text(need.limit_bytes) + ")\n";
  text += "  tiles in memory    " + megabytes_text(need.kept_bytes) + " of " +
          megabytes_text(need.tile_bytes);
  if (need.kept_bytes < need.tile_bytes) {
    text += need.overflow == TileOverflow::ReadBack
                ? "; the rest is read back from the progress folder"
                : "; the rest is cast again";
    text += formatted(" (disk %.0f MB/s, casting %.0f MB/s)",
                      run.disk.read_bytes_per_second / 1e6,
                      2e-6 * run.speed.rays_per_second * run.speed.occupied_fraction * run.ranks);
  }
  text += "\n";
  if (run.field.options.has_checkpoint)
    text += "  progress folder    " + megabytes_text(need.tile_bytes + need.payload_bytes) +
            " on disk until the field is complete\n";
  const std::uint64_t disk_bytes =
      need.file_bytes +
      (run.field.options.has_checkpoint ? need.tile_bytes + need.payload_bytes : 0);
  text += "  disk               " + megabytes_text(run.disk.available_bytes) + " left for " +
          megabytes_text(disk_bytes) +
          (disk_bytes > run.disk.available_bytes ? ": NOT ENOUGH\n" : "\n");
  return text;
}

/// What registrations by this field hold of it when they have looked at all of it: its samples if
/// they decode them, and those of the levels of half, a quarter, ... of its nodes along s and t.
std::string opened_text(const DryRun& run, const FieldForecast& need) {
  const FieldDesign design = run.field.options.design();
  const bool is_decoded =
      design.filters_tiles || run.field.parts.front().light_slab.slabs.size() > 1;
  return "  when opened        up to " +
         megabytes_text((is_decoded ? need.cropped_bytes : 0) + need.cropped_bytes / 3) +
         " of samples, once per node for all its ranks; only those that DRRs look at are made\n";
}

FieldForecast forecast(const DryRun& run) {
  const TileCounts tiles(run);
  const double codebook_bytes = 32.0 * run.field.options.design().codewords;
  FieldForecast need;
  need.uncropped_bytes = 2 * static_cast<std::uint64_t>(run.field.lattice.node_count());
  need.cropped_bytes = 2 * static_cast<std::uint64_t>(run.field.lattice.stored_node_count());
  need.payload_bytes =
      static_cast<std::uint64_t>(bytes_per_tile(run.field.options) * tiles.all + codebook_bytes);
  need.file_bytes = static_cast<std::uint64_t>(
      bytes_per_tile(run.field.options) * run.speed.compressed_fraction * tiles.occupied +
      kFileBytesPerCodeword * run.field.options.design().codewords);
  forecast_memory(run, tiles, need);
  forecast_seconds(run, tiles, need);
  return need;
}

std::string dry_run_text(const DryRun& run) {
  const FieldForecast need = forecast(run);
  const auto ratio = [](std::uint64_t raw, std::uint64_t stored) {
    return static_cast<double>(raw) / static_cast<double>(stored);
  };
  std::string text =
      "Field of camera " + run.field.source.camera.name + " for " + run.field.source.ct_path + "\n";
  text += "  range              " + run.field.source.range.text() + "\n";
  if (run.field.options.is_atlas()) text += parts_text(run.field.parts);
  text += planes_text(run.field.parts.front().light_slab);
  text += formatted("  rays               %.1f million stored of %.1f million\n",
                    static_cast<double>(run.field.lattice.stored_node_count()) / 1e6,
                    static_cast<double>(run.field.lattice.node_count()) / 1e6);
  text += formatted("  tiles              %.2f million, about %.0f %% not empty\n",
                    static_cast<double>(run.field.lattice.tile_count()) / 1e6,
                    100.0 * run.speed.occupied_fraction);
  text += formatted("  work               %zu units on %d ranks\n", run.units.size(), run.ranks);
  text += memory_text(run, need);
  text += "  raw field, 16 bit  " + megabytes_text(need.uncropped_bytes) + " uncropped, " +
          megabytes_text(need.cropped_bytes) + " cropped to the CT's shadow\n";
  text += "  payload            " + megabytes_text(need.payload_bytes) +
          formatted(" (1 : %.1f of uncropped, 1 : %.1f of cropped)\n",
                    ratio(need.uncropped_bytes, need.payload_bytes),
                    ratio(need.cropped_bytes, need.payload_bytes));
  text += "  file               about " + megabytes_text(need.file_bytes) +
          formatted(" (1 : %.1f of uncropped, 1 : %.1f of cropped)\n",
                    ratio(need.uncropped_bytes, need.file_bytes),
                    ratio(need.cropped_bytes, need.file_bytes));
  text += opened_text(run, need);
  text +=
      formatted("  time               about %.1f s (%s; %.1f million rays per second and rank)\n",
                need.all_seconds(),
                seconds_text(need.seconds).c_str(),
                run.speed.rays_per_second / 1e6);
  return text + advice_text(run.field.parts.front(), run.field.options);
}

std::filesystem::path output_folder(const PrecomputeOptions& options) {
  const std::filesystem::path output(options.output);
  return output.has_parent_path() ? output.parent_path() : ".";
}

}  // namespace

void print_dry_run(const SizedField& field, const FieldCaster& caster, const PrecomputeRun& run) {
  constexpr double kSampleSeconds = 1.0;
  const int ranks = run.world.size();
  const PlanOptions plan = field.unit_plan(ranks);
  std::vector<WorkUnit> units = plan_units(field.lattice, plan);
  const MemoryPlan memory = memory_plan(field, units, run);
  do_on_root(run.world, [&] {
    // These are the units that are cast to measure the speed.
    const PlanOptions small = caster_named(field.options.caster).sample;
    const PlanOptions sample = small.rays_per_unit < plan.rays_per_unit ? small : plan;
    const SpeedSample speed =
        sample_speed(caster, field.lattice, sample, field.options, kSampleSeconds);
    std::cout << dry_run_text({field,
                               std::move(units),
                               speed,
                               sample_disk(output_folder(field.options)),
                               memory,
                               run.clock.phases(),
                               ranks});
  });
}

}  // namespace af
