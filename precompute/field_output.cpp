// SPDX-License-Identifier: Apache-2.0
#include "precompute/field_output.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>

#include "base/build_info.h"
#include "base/error.h"
#include "field/parallel_write_check.h"
#include "files/options_toml.h"
#include "precompute/build/field_encoder.h"
#include "precompute/build_record.h"
#include "precompute/formatted_text.h"
#include "ranks/progress_printer.h"
#include "ranks/root_only.h"
#include "ranks/terminal.h"

namespace af {

namespace {

FieldIdentity identity_of(const FieldSource& source,
                          const MotionRange& range,
                          const PrecomputeOptions& options) {
  return {source.camera,
          source.frame,
          range,
          source.ct,
          options.attenuation.mu_water_per_mm,
          options.attenuation.air_below_hu,
          options.is_of_bone() ? FieldMaterial::Bone : FieldMaterial::All};
}

/// Collective.
FieldFileInfo write_file(const SizedField& field,
                         const Codebook& codebook,
                         const NextBlocks& next_blocks,
                         const MakeProvenance& make_provenance,
                         const Communicator& world) {
  const PrecomputeOptions& options = field.options;
  AttenuationAtlas atlas{identity_of(field.source, field.source.range, options),
                         {},
                         field.source.quantizer().step(),
                         codebook};
  for (const FieldPart& part : field.parts)
    atlas.members.push_back({identity_of(part.source, part.range, options), part.light_slab});
  const MpiIoHints hints = mpi_io_hints(options);
  if (options.is_atlas())
    return write_atlas(atlas, next_blocks, make_provenance, options.output, world, hints);
  return write_field(atlas.field(0), next_blocks, make_provenance, options.output, world, hints);
}

FieldProvenance provenance_of(const BuildRecord& record,
                              const SizedField& field,
                              const PrecomputeRun& run) {
  const FieldSource& source = field.source;
  PrecomputeOptions recorded = field.options;
  recorded.ct_reading = source.ct_reading;  // in force, where a study states it
  Provenance provenance = {"af-precompute",
                           run.command_line,
                           to_toml(recorded),
                           recorded.seed,
                           run.world.size(),
                           {{source.ct_path, source.ct}}};
  if (source.projections != nullptr)
    provenance.inputs[source.projections->path] = source.projections->content_sha256;
  nlohmann::json record_json = to_json(provenance);
  if (source.projections != nullptr)
    record_json["projections"] = {{"views", source.projections->views.size()},
                                  {"measured_rms", source.projections->measured_rms},
                                  {"residual_rms", source.projections->residual_rms}};
  add_record(record, record_json);
  return {std::string(program_version()),
          run.command_line,
          provenance.options_toml,
          record_json.dump(2)};
}

/// Collective. On NFS a folder cannot be removed while a rank has a file of it open.
void remove_progress(UnitStore& progress, const PrecomputeRun& run) {
  progress.close();
  run.world.barrier();
  do_on_root(run.world, [&] { run.folder.finish(); });
}

void report(const BuildRecord& record,
            const FieldFileInfo& info,
            const SizedField& field,
            const Communicator& world) {
  inform(world, record_text(record, info, field.lattice.stored_node_count()));
  if (world.is_root())
    std::cout << field.options.output << "  " << megabytes_text(info.file_bytes) << "  payload "
              << megabytes_text(info.payload_bytes) << "  sha256 " << info.payload_sha256
              << std::endl;
}

}  // namespace

MpiIoHints mpi_io_hints(const PrecomputeOptions& options) {
  MpiIoHints pairs;
  for (const std::string& hint : options.mpi_io_hints) {
    const std::size_t equals = hint.find('=');
    pairs.emplace_back(hint.substr(0, equals), hint.substr(equals + 1));
  }
  return pairs;
}

void open_output(const PrecomputeOptions& options, PrecomputeRun& run) {
  do_on_root(run.world, [&] {
    if (std::filesystem::is_directory(options.output))
      throw FileError(options.output, "is a folder, not a field file");
  });
  run.folder.open();
  do_on_root(run.world, [&] { announce_field(options.output); });
  check_parallel_writing(options.output, run.world, mpi_io_hints(options));
}

void write_encoded(const FieldBuild& build,
                   const SizedField& field,
                   CastPhase& cast,
                   const TrainedField& trained,
                   const OverflowChoice& choice,
                   PrecomputeRun& run) {
  const Codebook& codebook = trained.training.codebook;
  FieldEncoder encoder(build, cast, codebook, choice.overflow);
  std::optional<BuildRecord> record;
  std::optional<ProgressPrinter> printer;
  printer.emplace("encoding and writing", run.world.is_root());
  const FieldFileInfo info = write_file(
      field,
      codebook,
      [&] { return encoder.next_blocks(printer->callback(), run.stop_requested()); },
      [&] {
        record.emplace(BuildRecord{cast,
                                   trained,
                                   field.choice,
                                   run.clock,
                                   field.source.quantizer().step(),
                                   encoder.squared_error(),
                                   encoder.busy_seconds(),
                                   encoder.units_resumed(),
                                   peak_bytes_of_a_rank(field, run),
                                   field.volume_bytes()});
        run.clock.split(
            "encode",
            *std::max_element(record->encode_seconds.begin(), record->encode_seconds.end()));
        return provenance_of(*record, field, run);
      },
      run.world);
  printer.reset();
  if (build.progress != nullptr) remove_progress(*build.progress, run);
  run.clock.end("write");
  report(record.value(), info, field, run.world);
}

}  // namespace af
