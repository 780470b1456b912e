// SPDX-License-Identifier: Apache-2.0
#include "precompute/precompute_field.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <sstream>

#include "base/build_info.h"
#include "base/error.h"
#include "field/field_reading.h"
#include "field/field_writing.h"
#include "field/parallel_write_check.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "precompute/build/field_build.h"
#include "precompute/build/field_encoder.h"
#include "precompute/build/training_journal.h"
#include "precompute/build_record.h"
#include "precompute/cast_dependencies.h"
#include "precompute/casting/casters.h"
#include "precompute/casting/unit_planner.h"
#include "precompute/design_choice.h"
#include "precompute/dry_run.h"
#include "precompute/field_parts.h"
#include "precompute/formatted_text.h"
#include "precompute/phase_clock.h"
#include "ranks/progress_printer.h"
#include "ranks/run_folder.h"
#include "ranks/terminal.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

/// One run, phase by phase.
class PrecomputeRun {
 public:
  PrecomputeRun(const PrecomputeOptions& options,
                std::string command_line,
                const Communicator& communicator)
      : options_(options),
        command_line_(std::move(command_line)),
        world_(communicator),
        run_({options.output, {}, options.is_restart, keeps_progress(options)}, communicator) {}

  void run() {
    all_or_none(world_, [&] {
      // As stated first: what is in force has known names alone.
      throw_if_any(problems(options_));
      options_ = options_.in_force();
      throw_if_any(problems(options_));
      if (!options_.is_dry_run && options_.output.empty())
        throw UsageError("-o FIELD.h5 is needed (or --dry-run)");
    });
    if (!options_.is_dry_run) open_output();
    prepare();
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
  /// Whether a stop saves the finished work.
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

  /// Collective. Checks the output before the work, not after it.
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

  void prepare() {
    WorkNote note("reading the CT", WorkNote::Kind::Phase);
    source_ = load_source(options_, world_);
    for (const std::string& warning : source_.warnings) warn(world_, warning);
    if (source_.projections != nullptr) inform(world_, source_.projections->text());
    parts_ = field_parts(source_, options_, world_);
    // As one central slab first: resampling needs the slab frame alone, and cutting the CT into
    // slabs needs the resampled CT.
    for (FieldPart& part : parts_) size_planes(part, DepthSlabs{{}, {0.0}});
    lattice_ = lattice_of(parts_);
    clock_.end("read");
    const bool casting_needs_it = caster_named(options_.caster).needs_resampled;
    if (!casting_needs_it && !options_.needs_probe() && has_one_central_slab()) {
      space_nodes(std::vector<DepthSlabs>(parts_.size(), DepthSlabs{{}, {0.0}}));
      return;
    }
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      note.change(parts_.size() == 1 ? "resampling the CT"
                                     : "resampling the CT for " + std::to_string(i + 1) + " of " +
                                           std::to_string(parts_.size()) + " fields");
      parts_[i].resampled = resampled_on_node(parts_[i].light_slab.slab_from_ct);
    }
    clock_.end("resample");
    if (options_.needs_probe()) choose(parts_[parts_.size() / 2]);
    std::vector<DepthSlabs> depth_slabs;
    for (FieldPart& part : parts_) {
      depth_slabs.push_back(
          has_one_central_slab() ? DepthSlabs{{}, {0.0}} : all_or_none(world_, [&] {
            return choose_depth_slabs(
                *part.resampled, options_.design().slabs, options_.st_plane_rule());
          }));
      size_planes(part, depth_slabs.back());
      if (!casting_needs_it) part.resampled = nullptr;
    }
    lattice_ = lattice_of(parts_);
    space_nodes(depth_slabs);
  }

  /// Collective. Where the options state a spacing, the nodes of the (s,t) planes that it takes.
  void space_nodes(const std::vector<DepthSlabs>& depth_slabs) {
    if (!options_.st_spacing_mm) return;
    const double spacing_mm = *options_.st_spacing_mm;
    options_ = options_.with_st_nodes(
        all_or_none(world_, [&] { return st_nodes_at_most_apart(parts_, spacing_mm); }));
    inform(world_,
           formatted("(s,t) nodes at most %g mm apart: %d along each side of every plane",
                     spacing_mm,
                     *options_.st_nodes));
    for (std::size_t i = 0; i < parts_.size(); ++i) size_planes(parts_[i], depth_slabs[i]);
    lattice_ = lattice_of(parts_);
  }

  /// Collective. The CT in a slab frame, held once per node; the ranks of a node share the work.
  [[nodiscard]] std::shared_ptr<const SlabAlignedVolume> resampled_on_node(
      const RigidTransform& slab_from_ct) const {
    const AttenuationVolume& volume = *source_.volume;
    const SlabAlignedLayout layout =
        all_or_none(world_, [&] { return slab_aligned_layout(volume, slab_from_ct); });
    return std::make_shared<const SlabAlignedVolume>(
        volume, slab_from_ct, layout, [&](std::size_t bytes, const SlabAlignedFill& fill) {
          return world_.allocate_on_node_together(bytes, fill);
        });
  }

  [[nodiscard]] bool has_one_central_slab() const {
    return options_.design().slabs == 1 && options_.st_plane_rule() == StPlane::Centre;
  }

  /// Collective. Chooses the design within the budget; an atlas gets one for all members, by what
  /// one needs.
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

  /// The units that are cast to measure the speed.
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
    const ProcessMemory now = measured_memory();
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
      std::cout << dry_run_text({source_,
                                 parts_,
                                 lattice_,
                                 options_,
                                 std::move(units),
                                 volume_bytes(),
                                 speed,
                                 sample_disk(output_folder()),
                                 memory,
                                 clock_.phases(),
                                 world_.size()});
    });
  }

  void build(const FieldCaster& caster) {
    // A limit that is too low is refused before anything is made.
    const MemoryPlan memory = memory_plan(plan_units(lattice_, plan()));
    all_or_none(world_, [&] { (void)memory_limit(options_, memory); });
    const DecidingValues decides = cast_dependencies(options_, source_, parts_);
    UnfinishedWork work = run_.unfinished("units", decides);
    work.unit_size = plan().rays_per_unit;
    std::optional<UnitStore> progress;
    if (options_.has_checkpoint) progress.emplace(work, world_);
    if (progress.has_value() && progress->has_replaced_refused())
      inform(
          world_,
          "unfinished work in " + progress->path().string() +
              " is discarded: the options that it was made with were refused; this run has others");
    const auto units =
        plan_units(lattice_, {progress.has_value() ? progress->rays_per_unit() : work.unit_size});
    const FieldBuild build{caster,
                           lattice_,
                           units,
                           costs_over_parts(units, parts_),
                           progress.has_value() ? &*progress : nullptr,
                           world_};
    CastPhase cast = cast_phase(build);
    const OverflowChoice choice = overflow_choice(build, cast);
    TrainedCodebook trained = train_or_give_way(build, decides, cast);
    const FittedFilter fitted = fit_phase(build, trained.codebook);
    trained.codebook.filter = fitted.filter;
    write_phase(build, cast, trained, fitted, choice);
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
    const OverflowChoice choice = choose_overflow(build, cast);
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

  /// Collective. If options are refused only now, marks the unfinished work so that a later run
  /// with other options may discard it without --restart.
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
      const OptionTexts of_codebook = deciding_options(options_, kCodebookStage);
      decides.insert(of_codebook.begin(), of_codebook.end());
      journal.emplace(run_.unfinished("training", decides), options_.codebook_options(), world_);
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

  /// Collective. Without a filter where the design has none.
  [[nodiscard]] FittedFilter fit_phase(const FieldBuild& build, const Codebook& codebook) {
    if (!options_.design().filters_tiles) return {};
    const WorkNote note("fitting the tile filter");
    FittedFilter fitted = fit_filter(build, codebook, options_.seed);
    if (!fitted.filter)
      inform(
          world_,
          "tile filter: none, " + std::to_string(fitted.tiles) + " tiles are too few to fit one");
    clock_.end("fit filter");
    return fitted;
  }

  /// Encoding and writing take turns, so that no rank holds more than a round of indices.
  void write_phase(const FieldBuild& build,
                   CastPhase& cast,
                   const TrainedCodebook& trained,
                   const FittedFilter& fitted,
                   const OverflowChoice& choice) {
    FieldEncoder encoder(build, cast, trained.codebook, choice.overflow);
    std::optional<BuildRecord> record;
    std::optional<ProgressPrinter> printer;
    printer.emplace("encoding and writing", world_.is_root());
    const FieldFileInfo info = write_output(
        trained.codebook,
        [&] { return encoder.next_blocks(printer->callback(), stop_requested()); },
        [&] {
          record.emplace(record_of(trained, fitted, cast, encoder));
          clock_.split(
              "encode",
              *std::max_element(record->encode_seconds.begin(), record->encode_seconds.end()));
          return provenance_of(*record);
        });
    printer.reset();
    if (build.progress != nullptr) remove_progress(*build.progress);
    clock_.end("write");
    report(info, record.value());
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
            source.ct,
            model.mu_water_per_mm,
            model.air_below_hu,
            options_.is_of_bone() ? FieldMaterial::Bone : FieldMaterial::All};
  }

  /// Collective. A field, or an atlas.
  [[nodiscard]] FieldFileInfo write_output(const Codebook& codebook,
                                           const NextBlocks& next_blocks,
                                           const MakeProvenance& make_provenance) const {
    AttenuationAtlas atlas{identity_of(source_, source_.range), {}, quantizer().step(), codebook};
    for (const FieldPart& part : parts_)
      atlas.members.push_back({identity_of(part.source, part.range), part.light_slab});
    if (options_.is_atlas())
      return write_atlas(atlas, next_blocks, make_provenance, options_.output, world_, hints());
    return write_field(
        atlas.field(0), next_blocks, make_provenance, options_.output, world_, hints());
  }

  /// Collective.
  [[nodiscard]] BuildRecord record_of(const TrainedCodebook& trained,
                                      const FittedFilter& fitted,
                                      const CastPhase& cast,
                                      const FieldEncoder& encoder) const {
    return {cast,
            trained,
            fitted,
            choice_,
            clock_,
            quantizer().step(),
            encoder.squared_error(),
            encoder.busy_seconds(),
            encoder.units_resumed(),
            iterations_resumed_,
            largest_over_ranks(without_volume(measured_memory().peak_own_bytes)),
            volume_bytes()};
  }

  [[nodiscard]] FieldProvenance provenance_of(const BuildRecord& record) const {
    PrecomputeOptions recorded = options_;
    recorded.ct_reading = source_.ct_reading;  // in force, where a study states it
    Provenance provenance = {"af-precompute",
                             command_line_,
                             to_toml(recorded),
                             options_.seed,
                             world_.size(),
                             {{source_.ct_path, source_.ct}}};
    if (source_.projections != nullptr)
      provenance.inputs[source_.projections->path] = source_.projections->content_sha256;
    nlohmann::json json = to_json(provenance);
    if (source_.projections != nullptr)
      json["projections"] = {{"views", source_.projections->views.size()},
                             {"measured_rms", source_.projections->measured_rms},
                             {"residual_rms", source_.projections->residual_rms}};
    add_record(record, json);
    return {std::string(program_version()), command_line_, provenance.options_toml, json.dump(2)};
  }

  void report(const FieldFileInfo& info, const BuildRecord& record) const {
    inform(world_, record_text(record, info, lattice_.stored_node_count()));
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
