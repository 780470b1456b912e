// SPDX-License-Identifier: Apache-2.0
// Rays per second of one core: both casters of fields, ITK's caster and plastimatch, on one CT and
// camera.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <numeric>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "benchmark/alternating_rounds.h"
#include "benchmark/benchmark_case.h"
#include "benchmark/plastimatch_drr.h"
#include "cli/app_main.h"
#include "drr/ray_cast_drr.h"
#include "precompute/casting/shear_warp_caster.h"
#include "precompute/casting/trilinear_caster.h"
#include "support/itk_comparison.h"
#include "xray/psnr.h"

namespace af::benchmark {

namespace {

constexpr const char* kReference = "reference RayCaster, DRR, 1 mm";
constexpr const char* kItk = "itk::RayCastInterpolateImageFunction, DRR";
constexpr const char* kPlastimatch = "plastimatch drr exact, DRR";
constexpr const char* kShearWarp = "ShearWarpFieldCaster, field";
constexpr const char* kFieldReference = "TrilinearFieldCaster, field, 1 mm";

std::size_t rays_of(const std::vector<WorkUnit>& units) {
  return std::accumulate(
      units.begin(), units.end(), std::size_t{0}, [](std::size_t sum, const WorkUnit& unit) {
        return sum + unit.sample_count();
      });
}

/// The unit in the middle of the field, whose rays meet the CT. Those of a corner may miss it and
/// cost nothing.
WorkUnit middle_unit(const std::vector<WorkUnit>& units) {
  const auto middle_of = [](const NodeRange& range) { return range.begin + range.end(); };
  std::array<int, 4> last{};
  for (const WorkUnit& unit : units)
    last = {std::max(last[0], unit.u.end()),
            std::max(last[1], unit.v.end()),
            std::max(last[2], unit.s.end()),
            std::max(last[3], unit.t.end())};
  const auto distance = [&](const WorkUnit& unit) {
    return std::abs(middle_of(unit.u) - last[0]) + std::abs(middle_of(unit.v) - last[1]) +
           std::abs(middle_of(unit.s) - last[2]) + std::abs(middle_of(unit.t) - last[3]);
  };
  return *std::ranges::min_element(units, {}, distance);
}

Contender field_contender(const char* name,
                          const FieldCaster& caster,
                          const std::vector<WorkUnit>& units,
                          std::vector<std::uint16_t>& samples) {
  return {name, static_cast<double>(rays_of(units)), "rays", [&caster, &units, &samples] {
            return seconds_of([&] {
              for (const WorkUnit& unit : units) {
                samples.resize(unit.sample_count());
                caster.cast(unit, samples);
              }
            });
          }};
}

/// How well two images of the same rays agree: the factor between their units, and the PSNR. Throws
/// NumericError when they show different things, because comparing times would then mean nothing.
nlohmann::json agreement(const std::vector<float>& image, const std::vector<float>& reference) {
  double product = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    product += static_cast<double>(image[i]) * static_cast<double>(reference[i]);
    square += static_cast<double>(image[i]) * static_cast<double>(image[i]);
  }
  const double factor = square > 0.0 ? product / square : 0.0;
  std::vector<float> scaled(image);
  for (float& value : scaled) value *= static_cast<float>(factor);
  const auto quality = psnr(scaled, reference);
  // Casters differ in how they cut ray ends and interpolate; a shift by a pixel costs far more.
  constexpr double kLeastDb = 35.0;
  if (!quality.has_value() || !(quality->psnr_db > kLeastDb))
    throw NumericError("two casters do not see the same image: " +
                       std::to_string(quality ? quality->psnr_db : 0.0) + " dB");
  return {{"factor", factor}, {"psnr_db", quality->psnr_db}};
}

/// Seconds, rays and tiles of every unit of the field on one core, for a model of load balance.
nlohmann::json measure_units(const FieldCaster& caster, const std::vector<WorkUnit>& units) {
  nlohmann::json measured = nlohmann::json::array();
  std::vector<std::uint16_t> samples;
  for (const WorkUnit& unit : units) {
    samples.resize(unit.sample_count());
    const double cast_seconds = seconds_of([&] { caster.cast(unit, samples); });
    UnitTiles tiles;
    const double tile_seconds = seconds_of([&] { tiles = make_unit_tiles(unit, samples); });
    measured.push_back({{"rays", unit.sample_count()},
                        {"tiles_not_empty", tiles.tiles.size()},
                        {"cast_seconds", cast_seconds},
                        {"tile_seconds", tile_seconds}});
  }
  return measured;
}

nlohmann::json ratios_of(const std::vector<Timing>& timings) {
  nlohmann::json ratios = nlohmann::json::array();
  const auto add = [&](const char* fast, const char* slow) {
    const Timing* faster = find(timings, fast);
    const Timing* slower = find(timings, slow);
    if (faster != nullptr && slower != nullptr) ratios.push_back(speed_ratio(*faster, *slower));
  };
  for (const char* slow : {kPlastimatch, kItk}) {
    add(kReference, slow);
    add(kShearWarp, slow);
  }
  add(kShearWarp, kReference);
  add(kShearWarp, kFieldReference);
  return ratios;
}

void run(const CaseOptions& options, const std::string& work_folder) {
  const BenchmarkCase benchmark_case(options);
  const auto rays = static_cast<double>(benchmark_case.view().pixel_count());
  const RayFan fan = ray_fan(benchmark_case.frame().nominal_room_from_ct(), benchmark_case.view());
  const RayCaster reference(*benchmark_case.volume(), {});
  std::vector<float> image(benchmark_case.view().pixel_count());
  const auto itk = test::itk_caster_of(*benchmark_case.volume());
  const test::ItkFan itk_fan = test::itk_fan_of(fan);
  std::vector<float> itk_image;
  const auto plastimatch =
      PlastimatchDrr::prepare(benchmark_case, work_folder, options.is_quick ? 1 : 3);

  SlabAlignedOptions slab_aligned;
  std::shared_ptr<const SlabAlignedVolume> resampled;
  const double resample_seconds = seconds_of([&] {
    resampled = std::make_shared<const SlabAlignedVolume>(
        *benchmark_case.volume(), benchmark_case.light_slab().slab_from_ct, slab_aligned);
  });
  const ShearWarpFieldCaster shear_warp(
      *resampled, benchmark_case.light_slab(), benchmark_case.quantizer());
  const TrilinearFieldCaster field_reference(
      *benchmark_case.volume(), benchmark_case.light_slab(), benchmark_case.quantizer(), {});
  const std::vector<WorkUnit> units = benchmark_case.units();
  const std::vector<WorkUnit> some_units = evenly_spread(units, options.is_quick ? 1 : 4);
  const std::vector<WorkUnit> small_units = {
      middle_unit(plan_units(benchmark_case.light_slab().lattice(), {}))};
  std::vector<std::uint16_t> samples;

  std::vector<Contender> contenders = {
      {kReference, rays, "rays", [&] { return seconds_of([&] { reference.cast(fan, image); }); }},
      {kItk, rays, "rays", [&] { return seconds_of([&] { itk_image = itk->cast(itk_fan); }); }},
      field_contender(kShearWarp, shear_warp, some_units, samples),
      field_contender(kFieldReference, field_reference, small_units, samples)};
  if (plastimatch)
    contenders.push_back({kPlastimatch, rays * plastimatch->drrs_per_call(), "rays", [&] {
                            return plastimatch->run();
                          }});
  const std::vector<Timing> timings = alternate(contenders, options.rounds);

  nlohmann::json body{{"case", benchmark_case.description_with_field()},
                      {"results", to_json(timings)},
                      {"ratios", ratios_of(timings)},
                      {"resample_seconds", resample_seconds},
                      {"shear_warp_units_timed", some_units.size()},
                      {"agreement_with_reference", {{kItk, agreement(itk_image, image)}}},
                      {"units", measure_units(shear_warp, units)}};
  if (plastimatch) {
    body["agreement_with_reference"][kPlastimatch] = agreement(plastimatch->image(), image);
    body["plastimatch"] = {{"command", plastimatch->command()},
                           {"version", plastimatch->version()}};
  }
  write_section(options.output, "casting", body);
}

}  // namespace

}  // namespace af::benchmark

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::CaseOptions options;
  std::string work_folder;
  CLI::App app{"Rays per second of one core: both casters of fields, ITK's and plastimatch's."};
  af::benchmark::bind_case(app, options);
  app.add_option("--work", work_folder, "Folder for plastimatch's files")->required();
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator&) { af::benchmark::run(options, work_folder); });
}
