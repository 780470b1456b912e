// SPDX-License-Identifier: Apache-2.0
#include "precompute/precompute_program.h"

#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <sstream>

#include "base/build_info.h"
#include "base/error.h"
#include "cli/app_main.h"
#include "cli/progress_printer.h"
#include "io/output_file.h"
#include "io/provenance.h"
#include "precompute/dry_run_report.h"
#include "precompute/field_build_program.h"
#include "precompute/resampling_program.h"
#include "precompute/shear_warp_caster.h"
#include "precompute/source_loading.h"

namespace af {

namespace {

volatile std::sig_atomic_t stop_signal = 0;

extern "C" void remember_signal(int signal) {
  stop_signal = signal;
}

bool is_stop_requested() {
  return stop_signal != 0;
}

/// SIGUSR1 asks for a stop with progress saved; so does SIGTERM without mpirun (with it, mpirun
/// itself passes SIGTERM on as a kill).
void listen_for_stop_requests() {
  std::signal(SIGUSR1, remember_signal);
  if (std::getenv("OMPI_COMM_WORLD_SIZE") == nullptr) std::signal(SIGTERM, remember_signal);
}

/// Seconds of each phase, in order.
class PhaseClock {
 public:
  void end(const std::string& phase) {
    const auto now = std::chrono::steady_clock::now();
    seconds_.emplace_back(phase, std::chrono::duration<double>(now - start_).count());
    start_ = now;
  }
  [[nodiscard]] const std::vector<std::pair<std::string, double>>& phases() const {
    return seconds_;
  }
  [[nodiscard]] double seconds_of(const std::string& phase) const {
    for (const auto& [name, seconds] : seconds_)
      if (name == phase) return seconds;
    return 0.0;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::vector<std::pair<std::string, double>> seconds_;
};

std::string numbers_text(const double* values, Eigen::Index count) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < count; ++i) text += (i > 0 ? ", " : "") + exact_text(values[i]);
  return text + "]";
}

template <typename Derived>
std::string numbers_text(const Eigen::PlainObjectBase<Derived>& matrix) {
  return numbers_text(matrix.data(), matrix.size());
}

/// Everything that decides the cast samples. Options of the codebook may change between a stop and
/// its resume, for example after "more codewords than training tiles".
ProgressManifest manifest_of(const PrecomputeOptions& options,
                             const FieldSource& source,
                             const PlanOptions& plan) {
  ProgressManifest manifest;
  for (const auto& [name, value] : casting_options(options)) manifest.decides[name] = value;
  const CameraGeometry& camera = source.camera;
  manifest.decides["ct_content_sha256"] = source.ct_content_sha256;
  manifest.decides["camera"] = camera.name;
  manifest.decides["camera source_point"] = numbers_text(camera.source_point);
  manifest.decides["camera detector_origin_point"] = numbers_text(camera.detector_origin_point);
  manifest.decides["camera column_direction"] = numbers_text(camera.column_direction);
  manifest.decides["camera row_direction"] = numbers_text(camera.row_direction);
  manifest.decides["camera pixel_spacing_mm"] = numbers_text(camera.pixel_spacing_mm);
  manifest.decides["camera size_px"] =
      std::to_string(camera.size_px.x()) + " x " + std::to_string(camera.size_px.y());
  manifest.decides["nominal rotation"] = numbers_text(source.frame.rotation);
  manifest.decides["center_ct_mm"] = numbers_text(source.frame.center_ct_mm);
  manifest.decides["nominal center_room_mm"] = numbers_text(source.frame.center_room_mm);
  manifest.rays_per_unit = plan.rays_per_unit;
  return manifest;
}

/// Refuses before any work when a rank would need more than --memory-limit.
void require_memory(const PrecomputeOptions& options, const FieldForecast& need, int ranks) {
  if (need.bytes_per_rank <= options.memory_limit_bytes) return;
  throw InputError("memory_limit",
                   megabytes_text(options.memory_limit_bytes) + " per rank",
                   "this field needs about " + megabytes_text(need.bytes_per_rank) +
                       " on each of " + std::to_string(ranks) +
                       " ranks: use more ranks or nodes, fewer nodes of the planes, or raise it");
}

nlohmann::json training_json(const TrainedCodebook& trained) {
  nlohmann::json iterations = nlohmann::json::array();
  for (const TrainingIteration& iteration : trained.iterations)
    iterations.push_back({{"training_squared_error", iteration.training_squared_error},
                          {"held_out_squared_error", iteration.held_out_squared_error},
                          {"codewords_repaired", iteration.codewords_repaired}});
  return {{"training_tiles", trained.training_tiles},
          {"held_out_tiles", trained.held_out_tiles},
          {"stop", to_string(trained.stop)},
          {"iterations", iterations}};
}

/// Root mean square error of one element, in units of total attenuation.
double rms_attenuation(std::uint64_t squared_error, std::uint64_t tiles, float step) {
  if (tiles == 0) return 0.0;
  const double elements = static_cast<double>(tiles) * static_cast<double>(kTileElements);
  return static_cast<double>(step) * std::sqrt(static_cast<double>(squared_error) / elements);
}

std::string training_text(const TrainedCodebook& trained, float step) {
  std::ostringstream text;
  text << "codebook: " << trained.codebook.size() << " codewords from " << trained.training_tiles
       << " tiles, " << trained.iterations.size() << " iterations (" << to_string(trained.stop)
       << ")\n  rms error of training / unseen tiles per iteration:";
  text.precision(4);
  for (const TrainingIteration& iteration : trained.iterations)
    text << "  " << rms_attenuation(iteration.training_squared_error, trained.training_tiles, step)
         << " / "
         << rms_attenuation(iteration.held_out_squared_error, trained.held_out_tiles, step);
  return text.str();
}

/// One run, phase by phase.
class PrecomputeRun {
 public:
  PrecomputeRun(const PrecomputeOptions& options,
                std::string command_line,
                const Communicator& communicator)
      : options_(options), command_line_(std::move(command_line)), world_(communicator) {}

  void run() {
    all_or_none(world_, [&] {
      throw_if_any(problems(options_));
      if (!options_.is_dry_run && options_.output.empty())
        throw UsageError("-o FIELD.h5 is needed (or --dry-run)");
      if (!options_.is_dry_run && world_.is_root()) require_output_folder();
    });
    load();
    const std::unique_ptr<const FieldCaster> caster = make_caster();
    if (options_.is_dry_run) {
      print_dry_run(*caster);
      return;
    }
    all_or_none(world_, [&] {
      if (!world_.is_root() || options_.memory_limit_bytes == 0) return;
      constexpr double kSampleSeconds = 0.3;
      const CastSample sample =
          measure_casting(*caster, light_slab_, sample_plan(), kSampleSeconds);
      const FieldForecast need =
          forecast(light_slab_, options_, volume_bytes(), sample, world_.size());
      require_memory(options_, need, world_.size());
    });
    build(*caster);
  }

 private:
  [[nodiscard]] AttenuationQuantizer quantizer() const {
    return AttenuationQuantizer::for_maximum(source_.volume->max_total_attenuation());
  }

  /// Before the work, not after it.
  void require_output_folder() const {
    const std::filesystem::path output(options_.output);
    if (std::filesystem::is_directory(output))
      throw FileError(options_.output, "is a folder, not a field file");
    make_output_folder(output.has_parent_path() ? output.parent_path() : ".");
  }

  void load() {
    source_ = load_source(options_, world_);
    for (const std::string& warning : source_.warnings) cli::warn(world_, warning);
    size_planes(DepthSlabs{{}, {0.0}});
    clock_.end("read");
    if (!options_.is_shear_warp() && options_.slabs == 1) return;
    resampled_ = std::make_shared<const SlabAlignedVolume>(
        resample_on_node(*source_.volume, light_slab_.slab_from_ct, SlabAlignedOptions{}, world_));
    if (options_.slabs > 1)
      size_planes(
          all_or_none(world_, [&] { return choose_depth_slabs(*resampled_, options_.slabs); }));
    if (!options_.is_shear_warp()) resampled_ = nullptr;
    clock_.end("resample");
  }

  /// Collective.
  void size_planes(const DepthSlabs& depth_slabs) {
    const LightSlab light_slab = all_or_none(world_, [&] {
      return make_light_slab(source_.camera,
                             source_.frame,
                             options_.range(),
                             source_.volume->corner_points(),
                             options_.light_slab_spec(depth_slabs));
    });
    light_slab_ = shared_light_slab(light_slab, world_);
  }

  [[nodiscard]] std::unique_ptr<const FieldCaster> make_caster() const {
    if (options_.is_shear_warp())
      return std::make_unique<ShearWarpFieldCaster>(*resampled_, light_slab_, quantizer());
    return std::make_unique<RayCastFieldCaster>(
        *source_.volume, light_slab_, quantizer(), RayCasterOptions{options_.step_mm});
  }

  [[nodiscard]] PlanOptions plan() const {
    return plan_options_for_ranks(
        light_slab_, world_.size(), options_.is_shear_warp() ? kShearWarpPlan : PlanOptions{});
  }

  /// Units whose casting tells the speed: small ones, where size does not matter to the caster.
  [[nodiscard]] PlanOptions sample_plan() const {
    constexpr std::int64_t kSmallUnitRays = 4096;
    return options_.is_shear_warp() ? plan() : PlanOptions{kSmallUnitRays};
  }

  [[nodiscard]] std::uint64_t volume_bytes() const {
    return source_.volume->voxels().size_bytes() +
           (resampled_ == nullptr ? 0 : resampled_->grid().value_count() * sizeof(std::int16_t));
  }

  void print_dry_run(const FieldCaster& caster) const {
    constexpr double kSampleSeconds = 1.0;
    all_or_none(world_, [&] {
      if (world_.is_root())
        std::cout << dry_run_text(
            source_,
            light_slab_,
            options_,
            plan(),
            volume_bytes(),
            measure_casting(caster, light_slab_, sample_plan(), kSampleSeconds),
            world_.size());
    });
  }

  void build(const FieldCaster& caster) {
    ProgressManifest manifest = manifest_of(options_, source_, plan());
    std::optional<ProgressFolder> progress;
    if (options_.has_checkpoint) {
      listen_for_stop_requests();
      progress.emplace(options_.output + ".progress", options_.is_restart, manifest, world_);
    }
    const auto units = plan_units(light_slab_, {manifest.rays_per_unit});
    CastPhase cast = cast_phase(caster, units, progress);
    CompressedAttenuationField field = field_without_indices();
    const TrainedCodebook trained = train_phase(cast, units);
    field.codebook = trained.codebook;
    EncodePhase encoded = encode_phase(cast, units, trained.codebook);
    const FieldProvenance provenance = provenance_of(trained, cast, encoded);
    const FieldFileInfo info =
        write_field(field, encoded.blocks, provenance, options_.output, world_);
    if (progress.has_value()) progress->remove();
    clock_.end("write");
    report(info, cast, trained, encoded);
  }

  CastPhase cast_phase(const FieldCaster& caster,
                       const std::vector<WorkUnit>& units,
                       std::optional<ProgressFolder>& progress) {
    cli::ProgressPrinter printer("casting", world_.is_root());
    CastPhase cast = cast_field(caster,
                                units,
                                progress.has_value() ? &*progress : nullptr,
                                is_stop_requested,
                                printer.callback(),
                                world_);
    clock_.end("cast");
    if (cast.units_resumed > 0)
      cli::info(world_,
                "resumed " + std::to_string(cast.units_resumed) + " of " +
                    std::to_string(units.size()) + " units from " + progress->path().string());
    stop_if_requested();
    return cast;
  }

  TrainedCodebook train_phase(const CastPhase& cast, const std::vector<WorkUnit>& units) {
    cli::ProgressPrinter printer("training the codebook", world_.is_root());
    TrainedCodebook trained = train_field(cast,
                                          units,
                                          light_slab_,
                                          options_.training_selection(),
                                          options_.codebook_options(),
                                          printer.callback(),
                                          world_);
    clock_.end("train");
    stop_if_requested();
    return trained;
  }

  EncodePhase encode_phase(CastPhase& cast,
                           const std::vector<WorkUnit>& units,
                           const Codebook& codebook) {
    cli::ProgressPrinter printer("encoding", world_.is_root());
    EncodePhase encoded =
        encode_field(cast, units, light_slab_, codebook, printer.callback(), world_);
    clock_.end("encode");
    stop_if_requested();
    return encoded;
  }

  /// Collective. Every unit is saved once casting is over, so a stop loses little.
  void stop_if_requested() const {
    if (!options_.has_checkpoint) return;
    all_or_none(world_, [] {
      if (is_stop_requested())
        throw StoppedError("stopped with all units saved: run the same command again to go on");
    });
  }

  [[nodiscard]] CompressedAttenuationField field_without_indices() const {
    CompressedAttenuationField field;
    const AttenuationModel model = options_.attenuation_model();
    field.identity = {source_.camera,
                      source_.frame,
                      options_.range(),
                      source_.ct_content_sha256,
                      model.mu_water_per_mm,
                      model.air_below_hu};
    field.light_slab = light_slab_;
    field.quantizer_step = quantizer().step();
    return field;
  }

  [[nodiscard]] FieldProvenance provenance_of(const TrainedCodebook& trained,
                                              const CastPhase& cast,
                                              const EncodePhase& encoded) const {
    Provenance provenance;
    provenance.program = "af-precompute";
    provenance.command_line = command_line_;
    provenance.options_toml = to_toml(options_);
    provenance.seed = options_.seed;
    provenance.rank_count = world_.size();
    provenance.input_sha256[source_.ct_path] = source_.ct_content_sha256;
    nlohmann::json json = to_json(provenance);
    json["training"] = training_json(trained);
    json["occupied_tiles"] = cast.occupied_tiles;
    json["rms_attenuation_error"] =
        rms_attenuation(encoded.squared_error, cast.occupied_tiles, quantizer().step());
    json["rays_cast"] = cast.rays_cast;
    json["units_resumed"] = cast.units_resumed;
    for (const auto& [phase, seconds] : clock_.phases()) json["seconds"][phase] = seconds;
    return {std::string(program_version()), command_line_, provenance.options_toml, json.dump(2)};
  }

  void report(const FieldFileInfo& info,
              const CastPhase& cast,
              const TrainedCodebook& trained,
              const EncodePhase& encoded) const {
    const float step = quantizer().step();
    const auto rate = static_cast<double>(cast.rays_cast) / clock_.seconds_of("cast") / 1e6;
    const auto raw_bytes = static_cast<double>(2 * stored_ray_count(light_slab_));
    std::ostringstream text;
    text.precision(3);
    text << training_text(trained, step)
         << "\nwhole field: " << static_cast<double>(cast.occupied_tiles) / 1e6
         << " million tiles not empty, rms error "
         << rms_attenuation(encoded.squared_error, cast.occupied_tiles, step)
         << " (total attenuation)\nseconds:";
    for (const auto& [phase, seconds] : clock_.phases()) text << ' ' << phase << ' ' << seconds;
    text << "; cast " << rate << " million rays/s on " << world_.size()
         << " ranks\nratio of 16-bit "
         << "samples stored: payload 1 : " << raw_bytes / static_cast<double>(info.payload_bytes)
         << ", file 1 : " << raw_bytes / static_cast<double>(info.file_bytes);
    cli::info(world_, text.str());
    if (world_.is_root())
      std::cout << options_.output << "  " << megabytes_text(info.file_bytes) << "  payload "
                << megabytes_text(info.payload_bytes) << "  sha256 " << info.payload_sha256
                << std::endl;
  }

  const PrecomputeOptions& options_;
  std::string command_line_;
  const Communicator& world_;
  FieldSource source_;
  LightSlab light_slab_;
  std::shared_ptr<const SlabAlignedVolume> resampled_;  ///< for the shear-warp caster
  PhaseClock clock_;
};

}  // namespace

void run_precompute(const PrecomputeOptions& options,
                    const std::string& command_line,
                    const Communicator& communicator) {
  PrecomputeRun(options, command_line, communicator).run();
}

}  // namespace af
