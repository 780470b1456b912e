// SPDX-License-Identifier: Apache-2.0
#include "precompute/dry_run_report.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "base/hash_random.h"
#include "precompute/planner.h"
#include "precompute/unit_tiles.h"

namespace af {

namespace {

// Measured on one core at 2 to 3 GHz (tests/benchmark); a forecast needs no more than the order.
constexpr double kNearestSecondsPerTile = 0.5e-6;
constexpr double kIterationsExpected = 8.0;
constexpr double kFileSecondsPerByte = 2.0e-8;

template <typename... Values>
std::string formatted(const char* format, Values... values) {
  std::array<char, 512> text{};
  const int length = std::snprintf(text.data(), text.size(), format, values...);
  return {text.data(), std::min(text.size() - 1, static_cast<std::size_t>(std::max(0, length)))};
}

std::uint64_t uncropped_ray_count(const LightSlab& light_slab) {
  std::uint64_t rays = 0;
  for (const SlabGeometry& slab : light_slab.slabs)
    rays += static_cast<std::uint64_t>(slab.s.nodes) * static_cast<std::uint64_t>(slab.t.nodes);
  return rays * static_cast<std::uint64_t>(light_slab.u.nodes) *
         static_cast<std::uint64_t>(light_slab.v.nodes);
}

double stored_fraction(const LightSlab& light_slab) {
  return static_cast<double>(stored_ray_count(light_slab)) /
         static_cast<double>(uncropped_ray_count(light_slab));
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

std::string plane_text(const LightSlab& light_slab) {
  std::string text = axis_text("(u,v)", light_slab.u, light_slab.v);
  for (const SlabGeometry& slab : light_slab.slabs) {
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

/// The spacing that half the translation range would give with the same nodes.
std::string advice_text(const FieldSource& source,
                        const LightSlab& light_slab,
                        const PrecomputeOptions& options) {
  const SlabGeometry& slab = light_slab.slabs.front();
  std::string text = formatted(
      "Advice\n  Your range uses %.0f %% of the (s,t) plane; the rest holds no shadow of the CT "
      "and costs nothing.\n",
      100.0 * stored_fraction(light_slab));
  MotionRange narrower = options.range();
  narrower.max_translation_mm /= 2.0;
  if (narrower.max_translation_mm >= 5.0) {
    const LightSlab alternative =
        make_light_slab(source.camera,
                        source.frame,
                        narrower,
                        source.volume->corner_points(),
                        options.light_slab_spec({{}, {slab.st_plane_y_mm}}));
    text += formatted(
        "  With --max-translation-mm %.0f the same nodes would stand %.2f instead of %.2f mm apart "
        "on the (s,t) plane: sharper DRRs for the same size.\n",
        narrower.max_translation_mm,
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

}  // namespace

std::string megabytes_text(std::uint64_t bytes) {
  const double megabytes = static_cast<double>(bytes) / 1e6;
  return formatted(megabytes < 10.0 ? "%.2f MB" : "%.1f MB", megabytes);
}

CastSample measure_casting(const FieldCaster& caster,
                           const LightSlab& light_slab,
                           const PlanOptions& plan,
                           double seconds) {
  constexpr std::uint64_t kOrderSeed = 1;
  const auto units = plan_units(light_slab, plan);
  const auto start = std::chrono::steady_clock::now();
  double elapsed = 0.0;
  std::size_t rays = 0;
  std::size_t tiles = 0;
  std::size_t occupied = 0;
  std::vector<std::uint16_t> samples;
  for (std::uint64_t i = 0; elapsed < seconds && i < units.size(); ++i) {
    const WorkUnit& unit = units[hash64(kOrderSeed, i) % units.size()];
    samples.resize(unit.sample_count());
    caster.cast(unit, samples);
    const UnitTiles of_unit = make_unit_tiles(unit, samples);
    rays += samples.size();
    tiles += unit.tile_count();
    occupied += of_unit.tiles.size();
    elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  return {static_cast<double>(rays) / std::max(elapsed, 1e-9),
          static_cast<double>(occupied) / static_cast<double>(tiles)};
}

FieldForecast forecast(const LightSlab& light_slab,
                       const PrecomputeOptions& options,
                       std::uint64_t volume_bytes,
                       const CastSample& sample,
                       int ranks) {
  const auto rays = static_cast<double>(stored_ray_count(light_slab));
  const auto tiles = static_cast<double>(stored_tile_count(light_slab));
  const double occupied = tiles * sample.occupied_fraction;
  const double training = std::min(occupied * options.training_fraction,
                                   static_cast<double>(options.max_training_tiles));
  const double codebook_bytes = 32.0 * options.codewords;
  FieldForecast result;
  result.uncropped_bytes = 2 * uncropped_ray_count(light_slab);
  result.cropped_bytes = static_cast<std::uint64_t>(2.0 * rays);
  result.payload_bytes = static_cast<std::uint64_t>(2.0 * tiles + codebook_bytes);
  result.file_bytes = static_cast<std::uint64_t>(1.9 * occupied + codebook_bytes);
  result.ct_bytes_per_node = volume_bytes;
  // Tiles, training tiles with their working arrays, indices (twice while blocks are joined), and
  // centroid sums.
  constexpr double kTrainingBytesPerTile = 48.0 + 32.0 + 4.0 + 8.0 + 8.0 + 56.0;
  const double per_rank =
      (32.0 * occupied + kTrainingBytesPerTile * training + 4.0 * tiles) / ranks +
      400.0 * options.codewords;
  result.bytes_per_rank = static_cast<std::uint64_t>(per_rank);
  // Search time grows a little slower than the square root of the codebook.
  const double nearest_seconds =
      kNearestSecondsPerTile * std::max(0.3, std::sqrt(options.codewords / 16384.0));
  const double serial_seconds = kFileSecondsPerByte * static_cast<double>(result.payload_bytes);
  result.seconds = (rays / sample.rays_per_second +
                    nearest_seconds * (occupied + kIterationsExpected * training)) /
                       ranks +
                   serial_seconds;
  return result;
}

std::string dry_run_text(const FieldSource& source,
                         const LightSlab& light_slab,
                         const PrecomputeOptions& options,
                         const PlanOptions& plan,
                         std::uint64_t volume_bytes,
                         const CastSample& sample,
                         int ranks) {
  const FieldForecast need = forecast(light_slab, options, volume_bytes, sample, ranks);
  const auto units = plan_units(light_slab, plan);
  const auto ratio = [](std::uint64_t raw, std::uint64_t stored) {
    return static_cast<double>(raw) / static_cast<double>(stored);
  };
  std::string text = "Field of camera " + source.camera.name + " for " + source.ct_path + "\n";
  text += formatted("  range              +-%g degrees, +-%g mm\n",
                    options.max_rotation_deg,
                    options.max_translation_mm);
  text += plane_text(light_slab);
  text += formatted("  rays               %.1f million stored of %.1f million\n",
                    static_cast<double>(stored_ray_count(light_slab)) / 1e6,
                    static_cast<double>(uncropped_ray_count(light_slab)) / 1e6);
  text += formatted("  tiles              %.2f million, about %.0f %% not empty\n",
                    static_cast<double>(stored_tile_count(light_slab)) / 1e6,
                    100.0 * sample.occupied_fraction);
  text += formatted("  work               %zu units on %d ranks\n", units.size(), ranks);
  text += "  memory             " + megabytes_text(need.ct_bytes_per_node) +
          " per node for the CT, about " + megabytes_text(need.bytes_per_rank) + " per rank\n";
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
  text += formatted("  time               about %.0f s (%.2f million rays per second and rank)\n",
                    need.seconds,
                    sample.rays_per_second / 1e6);
  return text + advice_text(source, light_slab, options);
}

}  // namespace af
