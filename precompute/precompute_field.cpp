// SPDX-License-Identifier: Apache-2.0
#include "precompute/precompute_field.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <numeric>
#include <optional>
#include <sstream>

#include "base/build_info.h"
#include "base/error.h"
#include "field_file/field_file.h"
#include "files/output_file.h"
#include "parallel/work_watch.h"
#include "precompute/casting/casters.h"
#include "precompute/codebook/mean_removal.h"
#include "precompute/design_choice.h"
#include "precompute/dry_run.h"
#include "precompute/field_parts.h"
#include "precompute/field_planes.h"
#include "precompute/pipeline/field_build.h"
#include "precompute/pipeline/field_encoder.h"
#include "precompute/pipeline/shared_resampling.h"
#include "precompute/pipeline/training_checkpoints.h"
#include "precompute/units/unit_planner.h"
#include "run/progress_printer.h"
#include "run/run_folder.h"
#include "run/terminal.h"
#include "text/options_toml.h"

namespace af {

namespace {

/// Seconds of each phase, in order.
class PhaseClock {
 public:
  void end(const std::string& phase) {
    const auto now = std::chrono::steady_clock::now();
    seconds_.emplace_back(phase, std::chrono::duration<double>(now - start_).count());
    start_ = now;
  }
  /// Takes part of what has passed since the last end as a phase of its own.
  void split(const std::string& phase, double seconds) {
    seconds_.emplace_back(phase, seconds);
    start_ += std::chrono::duration_cast<std::chrono::steady_clock::duration>(
        std::chrono::duration<double>(seconds));
  }
  [[nodiscard]] const PhaseSeconds& phases() const { return seconds_; }
  [[nodiscard]] double seconds_of(const std::string& phase) const {
    for (const auto& [name, seconds] : seconds_)
      if (name == phase) return seconds;
    return 0.0;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  PhaseSeconds seconds_;
};

std::string numbers_text(const double* values, Eigen::Index count) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < count; ++i) text += (i > 0 ? ", " : "") + toml_float(values[i]);
  return text + "]";
}

template <typename Derived>
std::string numbers_text(const Eigen::PlainObjectBase<Derived>& matrix) {
  return numbers_text(matrix.data(), matrix.size());
}

/// Everything that decides the cast samples. Options of the codebook may change between a stop and
/// its resume, for example after "more codewords than training tiles".
DecidingValues casting_decides(const PrecomputeOptions& options,
                               const FieldSource& source,
                               const std::vector<FieldPart>& parts) {
  DecidingValues decides = deciding_values(deciding_options(options, kCastingStage), {});
  const auto add_camera = [&](const CameraGeometry& camera, const std::string& what) {
    decides[what] = camera.name;
    decides[what + " source_point"] = numbers_text(camera.source_point);
    decides[what + " detector_origin_point"] = numbers_text(camera.detector_origin_point);
    decides[what + " column_direction"] = numbers_text(camera.column_direction);
    decides[what + " row_direction"] = numbers_text(camera.row_direction);
    decides[what + " pixel_spacing_mm"] = numbers_text(camera.pixel_spacing_mm);
    decides[what + " size_px"] =
        std::to_string(camera.size_px.x()) + " x " + std::to_string(camera.size_px.y());
  };
  decides["ct_content_sha256"] = source.ct_content_sha256;
  if (source.projections != nullptr)
    decides["projections sha256"] = source.projections->content_sha256;
  add_camera(source.camera, "camera");
  for (std::size_t i = 0; i < source.more_cameras.size(); ++i)
    add_camera(source.more_cameras[i], "covered camera " + std::to_string(i + 1));
  for (std::size_t i = 0; options.is_atlas() && i < parts.size(); ++i) {
    const FieldSource& part = parts[i].source;
    const std::string of_member = " of member " + std::to_string(i);
    add_camera(part.camera, "camera" + of_member);
    decides["range" + of_member] = numbers_text(part.range.low.deg_and_mm().data(), 6) + " " +
                                   numbers_text(part.range.high.deg_and_mm().data(), 6);
    for (const HalfSpace& half_space : part.sources)
      decides["sources" + of_member] +=
          numbers_text(half_space.normal) + " " + numbers_text(&half_space.offset_mm, 1) + " ";
  }
  decides["nominal rotation"] = numbers_text(source.frame.rotation);
  decides["center_ct_mm"] = numbers_text(source.frame.center_ct_mm);
  decides["nominal center_room_mm"] = numbers_text(source.frame.center_room_mm);
  if (!options.cover.empty()) {
    decides["covered from"] = numbers_text(source.range.low.deg_and_mm().data(), 6);
    decides["covered to"] = numbers_text(source.range.high.deg_and_mm().data(), 6);
  }
  return decides;
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

nlohmann::json forecast_json(const DesignForecast& forecast) {
  return {{"design", to_text(forecast.design)},
          {"psnr_db", forecast.psnr_db},
          {"interpolation_db", forecast.interpolation_db},
          {"quantisation_db", forecast.quantisation_db},
          {"file_bytes", forecast.file_bytes},
          {"drr_ms", forecast.drr_ms}};
}

nlohmann::json design_json(const DesignChoice& choice) {
  nlohmann::json measured = nlohmann::json::array();
  for (const DesignForecast& forecast : choice.chosen.measured)
    measured.push_back(forecast_json(forecast));
  return {{"asked", choice.asked},
          {"chosen", forecast_json(choice.chosen.forecast)},
          {"measured", measured}};
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

/// What a build measured, over all ranks.
struct BuildStatistics {
  std::uint64_t squared_error = 0;  ///< in squared levels
  double rms_error = 0.0;           ///< total attenuation
  std::vector<double> encode_seconds;
  std::uint64_t units_encoded_before = 0;  ///< by earlier runs
  std::uint64_t peak_bytes_per_rank = 0;   ///< beside the CT and its grid
};

double largest_of(const std::vector<double>& seconds) {
  return *std::max_element(seconds.begin(), seconds.end());
}

/// Mean over largest: 1 when all ranks were equally long at work.
double balance_of(const std::vector<double>& seconds) {
  const double largest = largest_of(seconds);
  if (!(largest > 0.0)) return 1.0;
  return std::accumulate(seconds.begin(), seconds.end(), 0.0) /
         (largest * static_cast<double>(seconds.size()));
}

/// One run, phase by phase.
class PrecomputeRun {
 public:
  PrecomputeRun(const PrecomputeOptions& options,
                std::string command_line,
                const Communicator& communicator)
      : options_(options.in_force()),
        command_line_(std::move(command_line)),
        world_(communicator),
        run_({options.output, {}, options.is_restart, keeps_progress(options)}, communicator) {}

  void run() {
    all_or_none(world_, [&] {
      throw_if_any(problems(options_));
      if (!options_.is_dry_run && options_.output.empty())
        throw UsageError("-o FIELD.h5 is needed (or --dry-run)");
    });
    if (!options_.is_dry_run) open_output();
    load();
    run_.stop_if_requested("before the first unit");
    const std::unique_ptr<const FieldCaster> caster = make_caster(parts_, options_, quantizer());
    if (options_.is_dry_run) {
      print_dry_run(*caster);
      return;
    }
    check_writing_many_chunks(lattice_, options_.output, world_, hints());
    build(*caster);
  }

 private:
  /// Without progress there is nothing to stop for.
  static bool keeps_progress(const PrecomputeOptions& options) {
    return options.has_checkpoint && !options.is_dry_run;
  }

  [[nodiscard]] AttenuationQuantizer quantizer() const {
    return AttenuationQuantizer::for_maximum(source_.volume->max_total_attenuation());
  }

  [[nodiscard]] MpiIoHints hints() const {
    MpiIoHints pairs;
    for (const std::string& hint : options_.mpi_io_hints) {
      const std::size_t equals = hint.find('=');
      pairs.emplace_back(hint.substr(0, equals), hint.substr(equals + 1));
    }
    return pairs;
  }

  /// Collective. Before the work, not after it.
  void open_output() {
    all_or_none(world_, [&] {
      if (world_.is_root() && std::filesystem::is_directory(options_.output))
        throw FileError(options_.output, "is a folder, not a field file");
    });
    run_.open();
    all_or_none(world_, [&] {
      if (world_.is_root()) announce_field(options_.output);
    });
    check_parallel_writing(options_.output, world_, hints());
  }

  void load() {
    WorkNote note("reading the CT", WorkNote::Kind::Phase);
    source_ = load_source(options_, world_);
    for (const std::string& warning : source_.warnings) warn(world_, warning);
    if (source_.projections != nullptr) inform(world_, source_.projections->text());
    parts_ = field_parts(source_, options_, world_);
    for (FieldPart& part : parts_) size_planes(part, DepthSlabs{{}, {0.0}});
    lattice_ = lattice_of(parts_);
    clock_.end("read");
    const bool is_for_casting = caster_named(options_.caster).needs_resampled;
    if (!is_for_casting && !options_.needs_probe() && has_one_central_slab()) return;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      note.change(parts_.size() == 1 ? "resampling the CT"
                                     : "resampling the CT for " + std::to_string(i + 1) + " of " +
                                           std::to_string(parts_.size()) + " fields");
      parts_[i].resampled = std::make_shared<const SlabAlignedVolume>(resample_on_node(
          *source_.volume, parts_[i].light_slab.slab_from_ct, SlabAlignedOptions{}, world_));
    }
    clock_.end("resample");
    if (options_.needs_probe()) choose(parts_[parts_.size() / 2]);
    for (FieldPart& part : parts_) {
      size_planes(part, has_one_central_slab() ? DepthSlabs{{}, {0.0}} : all_or_none(world_, [&] {
                    return choose_depth_slabs(
                        *part.resampled, options_.design().slabs, options_.st_plane_rule());
                  }));
      if (!is_for_casting) part.resampled = nullptr;
    }
    lattice_ = lattice_of(parts_);
  }

  [[nodiscard]] bool has_one_central_slab() const {
    return options_.design().slabs == 1 && options_.st_plane_rule() == StPlane::Centre;
  }

  /// Collective. The design within the budget; of an atlas, one for all, by what a member needs.
  void choose(const FieldPart& part) {
    WorkNote note("probing designs", WorkNote::Kind::Phase);
    choice_ = all_or_none(world_, [&] {
      return choose_design(part.source, *part.resampled, options_, quantizer(), world_);
    });
    options_ = options_.with_design(choice_->chosen.forecast.design).in_force();
    inform(world_, choice_text(*choice_));
    clock_.end("probe");
  }

  /// Collective.
  void size_planes(FieldPart& part, const DepthSlabs& depth_slabs) {
    part.light_slab = all_or_none(world_, [&] {
      return sized_planes(part.source, options_, part.source.range, depth_slabs);
    });
    share_geometry(part.light_slab, world_);
  }

  [[nodiscard]] PlanOptions plan() const {
    return plan_options_for_ranks(lattice_, world_.size(), caster_named(options_.caster).plan);
  }

  /// Units whose casting tells the speed.
  [[nodiscard]] PlanOptions sample_plan() const {
    const PlanOptions sample = caster_named(options_.caster).sample;
    return sample.rays_per_unit < plan().rays_per_unit ? sample : plan();
  }

  [[nodiscard]] std::uint64_t volume_bytes() const {
    std::uint64_t bytes = source_.volume->voxels().size_bytes();
    if (source_.projections != nullptr) bytes += source_.projections->bytes;
    for (const FieldPart& part : parts_)
      if (part.resampled != nullptr) bytes += part.resampled->bytes();
    return bytes;
  }

  /// Collective. Memory of the rank that has most of its own.
  [[nodiscard]] std::uint64_t largest_over_ranks(std::uint64_t bytes) const {
    std::array<std::uint64_t, 1> largest{bytes};
    world_.maximum(largest);
    return largest[0];
  }

  /// Alone on its node, a rank holds the CT and its grid as memory of its own.
  [[nodiscard]] std::uint64_t without_volume(std::uint64_t own_bytes) const {
    return ranks_on_node_ > 1 ? own_bytes : own_bytes - std::min(own_bytes, volume_bytes());
  }

  /// Collective.
  [[nodiscard]] MemoryPlan memory_plan(const std::vector<WorkUnit>& units) const {
    // The program's pages are shared by the ranks of a node, but the first rank counts, too.
    const ProcessMemory now = process_memory();
    const std::uint64_t fixed =
        largest_over_ranks(without_volume(now.own_bytes) + now.program_bytes);
    return plan_memory(lattice_, units, options_, fixed, world_.size());
  }

  [[nodiscard]] std::filesystem::path output_folder() const {
    const std::filesystem::path output(options_.output);
    return output.has_parent_path() ? output.parent_path() : ".";
  }

  void print_dry_run(const FieldCaster& caster) const {
    constexpr double kSampleSeconds = 1.0;
    std::vector<WorkUnit> units = plan_units(lattice_, plan());
    const MemoryPlan memory = memory_plan(units);
    all_or_none(world_, [&] {
      if (!world_.is_root()) return;
      const SpeedSample speed =
          sample_speed(caster, lattice_, sample_plan(), options_, kSampleSeconds);
      const FieldPart& first = parts_.front();
      std::cout << dry_run_text({source_,
                                 lattice_,
                                 options_,
                                 std::move(units),
                                 volume_bytes(),
                                 speed,
                                 sample_disk(output_folder()),
                                 memory,
                                 clock_.phases(),
                                 world_.size(),
                                 what_text(),
                                 advice_text(first.source, first.light_slab, options_)});
    });
  }

  /// Of a dry run: the planes, of an atlas those of its first field.
  [[nodiscard]] std::string what_text() const {
    return (options_.is_atlas() ? parts_text(parts_) : "") + planes_text(parts_.front().light_slab);
  }

  void build(const FieldCaster& caster) {
    // A limit that is too low is refused before anything is made.
    const MemoryPlan memory = memory_plan(plan_units(lattice_, plan()));
    all_or_none(world_, [&] { (void)memory_limit(options_, memory); });
    const DecidingValues decides = casting_decides(options_, source_, parts_);
    UnfinishedWork work = run_.unfinished("units", decides);
    work.plan = plan().rays_per_unit;
    std::optional<UnitStore> progress;
    if (options_.has_checkpoint) progress.emplace(work, world_);
    if (progress.has_value() && progress->has_replaced_refused())
      inform(world_,
             "unfinished work in " + progress->path().string() +
                 " is discarded: its options were refused, and they have changed");
    const auto units =
        plan_units(lattice_, {progress.has_value() ? progress->rays_per_unit() : work.plan});
    const FieldBuild build{caster,
                           lattice_,
                           units,
                           unit_costs(units, parts_),
                           progress.has_value() ? &*progress : nullptr,
                           world_};
    CastPhase cast = cast_phase(build);
    const OverflowChoice choice = overflow_choice(build, cast);
    const TrainedCodebook trained = train_or_give_way(build, decides, cast);
    write_phase(build, cast, trained, choice);
  }

  CastPhase cast_phase(const FieldBuild& build) {
    const MemoryPlan plan = memory_plan(build.units);
    const std::uint64_t limit = all_or_none(world_, [&] { return memory_limit(options_, plan); });
    forget_peak();
    ProgressPrinter printer("casting", world_.is_root());
    CastPhase cast = cast_field(build,
                                {options_.training_selection(), plan.kept_tile_bytes(limit)},
                                stop_requested(),
                                printer.callback());
    clock_.end("cast");
    if (cast.units_resumed > 0)
      inform(world_,
             "resumed " + std::to_string(cast.units_resumed) + " of " +
                 std::to_string(build.units.size()) + " units from " +
                 build.progress->path().string());
    run_.stop_if_requested("with all units saved");
    return cast;
  }

  /// Collective. Says where the tiles are.
  OverflowChoice overflow_choice(const FieldBuild& build, const CastPhase& cast) {
    const std::size_t units = build.units.size();
    if (cast.units_kept == units) {
      inform(world_, "tiles: all " + tile_bytes_text(cast) + " kept in memory");
      return {};
    }
    OverflowChoice choice = choose_overflow(build, cast);
    if (options_.overflow == "cast-again") choice.overflow = TileOverflow::CastAgain;
    if (options_.overflow == "read-back" && build.progress != nullptr)
      choice.overflow = TileOverflow::ReadBack;
    std::ostringstream text;
    text.precision(3);
    text << "tiles: " << cast.units_kept << " of " << units << " units (" << tile_bytes_text(cast)
         << " in all) kept in memory; the others are "
         << (choice.overflow == TileOverflow::ReadBack
                 ? "read back from " + build.progress->path().string()
                 : "cast again");
    if (choice.read_bytes_per_second > 0.0)
      text << " (a rank reads " << choice.read_bytes_per_second / 1e6 << " MB/s, casts "
           << choice.cast_bytes_per_second / 1e6 << " MB/s)";
    inform(world_, text.str());
    return choice;
  }

  static std::string tile_bytes_text(const CastPhase& cast) {
    return megabytes_text(cast.occupied_tiles * sizeof(Tile));
  }

  /// Collective. Options that are refused only now must not stand in the way of better ones.
  TrainedCodebook train_or_give_way(const FieldBuild& build,
                                    const DecidingValues& decides,
                                    CastPhase& cast) {
    try {
      all_or_none(world_, [&] { require_something_seen(cast); });
      return train_phase(build, decides, cast);
    } catch (const Error& error) {
      if (error.exit_code() == ExitCode::Input && build.progress != nullptr)
        build.progress->give_way();
      throw;
    }
  }

  void require_something_seen(const CastPhase& cast) const {
    if (cast.occupied_tiles > 0) return;
    throw InputError("camera",
                     source_.camera.name,
                     "its detector misses the CT: no ray to it meets anything but air, wherever "
                     "the CT is within the range; check the rig, the nominal pose and the centre");
  }

  TrainedCodebook train_phase(const FieldBuild& build, DecidingValues decides, CastPhase& cast) {
    ProgressPrinter printer("training the codebook", world_.is_root());
    const auto iteration = [](std::size_t done) {
      return "training the codebook, iteration " + std::to_string(done + 1);
    };
    std::optional<TrainingJournal> journal;
    TrainingCheckpoints checkpoints;
    WorkNote note(iteration(0));
    if (build.progress != nullptr) {
      decides.merge(deciding_options(options_, kCodebookStage));
      journal.emplace(run_.unfinished("training", decides),
                      static_cast<std::size_t>(options_.codebook_options().codewords),
                      world_);
      checkpoints.begun = journal->begun();
      checkpoints.on_iteration = [&](const TrainedCodebook& so_far) {
        journal->append(so_far);
        note.change(iteration(so_far.iterations.size()));
        run_.stop_if_requested("with all units and " + std::to_string(so_far.iterations.size()) +
                               " iterations of the training saved");
      };
    }
    iterations_resumed_ = checkpoints.begun ? checkpoints.begun->iterations.size() : 0;
    if (iterations_resumed_ > 0)
      inform(world_,
             "resumed " + std::to_string(iterations_resumed_) + " iterations of the training");
    TrainedCodebook trained =
        train_field(build, cast, options_.codebook_options(), printer.callback(), checkpoints);
    clock_.end("train");
    return trained;
  }

  /// Encoding and writing take turns, so that no rank holds more than a round of indices.
  void write_phase(const FieldBuild& build,
                   CastPhase& cast,
                   const TrainedCodebook& trained,
                   const OverflowChoice& choice) {
    FieldEncoder encoder(
        build, cast, trained.codebook, options_.design().mean_step, choice.overflow);
    BuildStatistics statistics;
    std::optional<ProgressPrinter> printer;
    printer.emplace("encoding and writing", world_.is_root());
    const FieldFileInfo info = write_output(
        trained.codebook,
        [&] { return encoder.next_blocks(printer->callback(), stop_requested()); },
        [&] {
          statistics = statistics_of(cast, encoder);
          clock_.split("encode", largest_of(statistics.encode_seconds));
          return provenance_of(trained, cast, statistics);
        });
    printer.reset();
    if (build.progress != nullptr) remove_progress(*build.progress);
    clock_.end("write");
    report(info, cast, trained, statistics);
  }

  /// Collective. On NFS a folder cannot be removed while a rank has a file of it open.
  void remove_progress(UnitStore& progress) const {
    progress.close();
    world_.barrier();
    all_or_none(world_, [&] {
      if (world_.is_root()) run_.finish();
    });
  }

  [[nodiscard]] StopRequested stop_requested() const {
    return [this] { return run_.is_stop_requested(); };
  }

  [[nodiscard]] FieldIdentity identity_of(const FieldSource& source,
                                          const MotionRange& range) const {
    const AttenuationModel& model = options_.attenuation;
    return {source.camera,
            source.frame,
            range,
            source.ct_content_sha256,
            model.mu_water_per_mm,
            model.air_below_hu,
            options_.is_of_bone() ? FieldMaterial::Bone : FieldMaterial::All};
  }

  /// Collective. A field, or an atlas.
  [[nodiscard]] FieldFileInfo write_output(const Codebook& trained,
                                           const NextBlocks& next_blocks,
                                           const MakeProvenance& make_provenance) const {
    const IndexPacking packing =
        options_.packs_by_codebook_tree() ? IndexPacking::CodebookTree : IndexPacking::Deflate;
    AttenuationAtlas atlas{identity_of(source_, source_.range),
                           {},
                           quantizer().step(),
                           field_codebook(trained, options_.design().mean_step)};
    for (const FieldPart& part : parts_)
      atlas.members.push_back({identity_of(part.source, part.range), part.light_slab});
    if (options_.is_atlas())
      return write_atlas(
          atlas, next_blocks, make_provenance, options_.output, world_, hints(), packing);
    return write_field(
        atlas.field(0), next_blocks, make_provenance, options_.output, world_, hints(), packing);
  }

  /// Collective.
  [[nodiscard]] BuildStatistics statistics_of(const CastPhase& cast,
                                              const FieldEncoder& encoder) const {
    BuildStatistics statistics;
    statistics.squared_error = encoder.squared_error();
    statistics.rms_error =
        rms_attenuation(statistics.squared_error, cast.occupied_tiles, quantizer().step());
    statistics.encode_seconds = encoder.busy_seconds();
    statistics.units_encoded_before = encoder.units_resumed();
    statistics.peak_bytes_per_rank =
        largest_over_ranks(without_volume(process_memory().peak_own_bytes));
    return statistics;
  }

  [[nodiscard]] FieldProvenance provenance_of(const TrainedCodebook& trained,
                                              const CastPhase& cast,
                                              const BuildStatistics& statistics) const {
    PrecomputeOptions recorded = options_;
    recorded.ct_reading = source_.ct_reading;  // in force, where a study states it
    Provenance provenance = {"af-precompute",
                             command_line_,
                             to_toml(recorded),
                             options_.seed,
                             world_.size(),
                             {{source_.ct_path, source_.ct_content_sha256}}};
    if (source_.projections != nullptr)
      provenance.input_sha256[source_.projections->path] = source_.projections->content_sha256;
    nlohmann::json json = to_json(provenance);
    if (source_.projections != nullptr)
      json["projections"] = {{"views", source_.projections->views.size()},
                             {"measured_rms", source_.projections->measured_rms},
                             {"residual_rms", source_.projections->residual_rms}};
    json["training"] = training_json(trained);
    if (choice_) json["design"] = design_json(*choice_);
    json["occupied_tiles"] = cast.occupied_tiles;
    json["rms_attenuation_error"] = statistics.rms_error;
    json["rays_cast"] = cast.rays_cast;
    json["units_resumed"] = cast.units_resumed;
    json["training_iterations_resumed"] = iterations_resumed_;
    json["units_encoded_before"] = statistics.units_encoded_before;
    json["units_kept_in_memory"] = cast.units_kept;
    json["busy_seconds"] = {{"cast", cast.busy_seconds}, {"encode", statistics.encode_seconds}};
    json["peak_bytes"] = {{"per_rank", statistics.peak_bytes_per_rank},
                          {"ct_and_grid_per_node", volume_bytes()}};
    for (const auto& [phase, seconds] : clock_.phases()) json["seconds"][phase] = seconds;
    return {std::string(program_version()), command_line_, provenance.options_toml, json.dump(2)};
  }

  void report(const FieldFileInfo& info,
              const CastPhase& cast,
              const TrainedCodebook& trained,
              const BuildStatistics& statistics) const {
    const auto rate = static_cast<double>(cast.rays_cast) / clock_.seconds_of("cast") / 1e6;
    const auto raw_bytes = static_cast<double>(2 * lattice_.stored_node_count());
    std::ostringstream text;
    text.precision(3);
    text << training_text(trained, quantizer().step())
         << "\nwhole field: " << static_cast<double>(cast.occupied_tiles) / 1e6
         << " million tiles not empty, rms error " << statistics.rms_error
         << " (total attenuation)\nseconds: " << seconds_text(clock_.phases()) << "; cast " << rate
         << " million rays/s on " << world_.size() << " ranks\nbalance (mean / slowest rank): cast "
         << balance_of(cast.busy_seconds) << ", encode " << balance_of(statistics.encode_seconds)
         << "; peak memory " << megabytes_text(statistics.peak_bytes_per_rank)
         << " of one rank beside " << megabytes_text(volume_bytes())
         << " per node for the CT\nratio of 16-bit samples stored: payload 1 : "
         << raw_bytes / static_cast<double>(info.payload_bytes)
         << ", file 1 : " << raw_bytes / static_cast<double>(info.file_bytes);
    inform(world_, text.str());
    if (world_.is_root())
      std::cout << options_.output << "  " << megabytes_text(info.file_bytes) << "  payload "
                << megabytes_text(info.payload_bytes) << "  sha256 " << info.payload_sha256
                << std::endl;
  }

  PrecomputeOptions options_;  ///< with the design, once it is chosen
  std::optional<DesignChoice> choice_;
  std::string command_line_;
  const Communicator& world_;
  RunFolder run_;
  int ranks_on_node_ = world_.node().size();
  FieldSource source_;
  std::vector<FieldPart> parts_;        ///< one, or the members of an atlas
  FieldLattice lattice_;                ///< of all of them
  std::size_t iterations_resumed_ = 0;  ///< of the training, by earlier runs
  PhaseClock clock_;
};

}  // namespace

void run_precompute(const PrecomputeOptions& options,
                    const std::string& command_line,
                    const Communicator& communicator) {
  PrecomputeRun(options, command_line, communicator).run();
}

}  // namespace af
