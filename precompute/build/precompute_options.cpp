// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/precompute_options.h"

#include <algorithm>

#include "base/number_text.h"
#include "base/plausible.h"
#include "base/toml_text.h"
#include "precompute/build/axis_ranges.h"
#include "precompute/build/orbit_text.h"
#include "precompute/casting/casters.h"
#include "precompute/casting/least_squares_caster.h"

namespace af {

namespace {

void append(const std::vector<std::string>& more, std::vector<std::string>& found) {
  found.insert(found.end(), more.begin(), more.end());
}

void describe_source(Fields& field, PrecomputeOptions& options) {
  field("ct", options.ct, "CT: image file or DICOM folder").input();
  describe_beside_ct(field, options.ct_reading);
  field("rig", options.rig, "Cameras: a rig.toml, or a shipped rig: c-arm-12in, treatment-room")
      .input();
  field("camera",
        options.camera,
        "Camera of the rig, in upper or lower case (a field belongs to one camera)")
      .input();
  field("center_ct_mm",
        options.center_ct_mm,
        "x,y,z: point of the CT (DICOM LPS, mm) about which it turns and which the nominal pose "
        "puts at the isocentre [CT centre]")
      .count(3)
      .comma_separated()
      .input();
  field("nominal_pose",
        options.nominal_pose,
        "File with room_from_ct about which the range is taken [identity rotation, centre at the "
        "rig's isocentre]")
      .input();
  field("study", options.study, "study.toml that names CT, rig, pose and centre instead")
      .excludes({"--ct", "--rig", "--center-ct-mm", "--nominal-pose"})
      .input();
  field("case", options.case_name, "Case of the study [the only one]").needs({"--study"}).input();
}

void describe_casting(Fields& field, PrecomputeOptions& options) {
  field("max_rotation_deg",
        options.max_rotation_deg,
        "Range: largest angle about each room axis, degrees")
      .decides(kCastingStage);
  field("max_translation_mm",
        options.max_translation_mm,
        "Range: largest shift along each room axis, mm")
      .decides(kCastingStage);
  field("rotation_range_deg",
        options.rotation_range_deg,
        "Range per axis, degrees, such as rx=-15:15,ry=-5:5,rz=-30:30; one number stands for both "
        "sides; axes not named keep --max-rotation-deg")
      .decides(kCastingStage);
  field("translation_range_mm",
        options.translation_range_mm,
        "Range per axis, mm, such as tx=-20:20,ty=-80:40,tz=30; axes not named keep "
        "--max-translation-mm")
      .decides(kCastingStage);
  field("cover",
        options.cover,
        "File of poses (docs/poses.md): the field covers the range about each of them instead of "
        "the nominal pose")
      .input();
  field("cover_rig",
        options.cover_rig,
        "Rig of further cameras: the field holds their rays, too, over the same range")
      .input();
  field("orbit",
        options.orbit,
        "Make an atlas, a file of many fields, for a camera that turns: "
        "axis=z,from=-90,to=90[,step=10][,members=by-pose], degrees about the room's z through the "
        "isocentre (docs/other-cameras.md)")
      .decides(kCastingStage);
  field("orbit_cameras",
        options.orbit_cameras,
        "Make an atlas with a field for --camera and for every camera of this rig, each over the "
        "same range")
      .excludes({"--orbit"})
      .input();
  field("preset",
        options.preset,
        "Design of the field, by name. " + design_preset_help() + " [" + kDefaultPreset +
            "; atlas with --orbit and --orbit-cameras; paper where parts of the design are stated]")
      .one_of(design_preset_names())
      .excludes({"--target-psnr-db", "--max-field-size", "--max-drr-ms"})
      .not_recorded("the design that it stands for is");
  field.part(options.budget);
  for (const char* name : {"target_psnr_db", "max_field_bytes", "max_drr_ms"})
    field.at(name).not_deciding("the design that it chooses decides");
  field("slabs",
        options.slabs,
        "Depth slabs, each with its own (s,t) plane; the paper has 1, and with 8 some 8 --uv-nodes "
        "suffice [the preset's, else 1]")
      .within(1, 64)
      .decides(kCastingStage);
  field("st_plane",
        options.st_plane,
        "Where the (s,t) planes stand: centre (all through the field's centre) or centroid (each "
        "where its slab's attenuation is) [centre for one slab, else centroid]")
      .one_of({"centre", "centroid"})
      .decides(kCastingStage);
  field(
      "uv_nodes",
      options.uv_nodes,
      "Viewpoints along each side of the (u,v) plane, both edges included [the preset's, else 64]")
      .within(2, kMostPlaneNodes)
      .decides(kCastingStage);
  field("st_nodes",
        options.st_nodes,
        "Nodes along each side of the uncropped (s,t) plane, both edges included [the preset's, "
        "else 256]")
      .within(2, kMostPlaneNodes)
      .decides(kCastingStage);
  field("st_spacing_mm",
        options.st_spacing_mm,
        "Instead of --st-nodes: largest distance of (s,t) nodes, mm; half the CT's voxel is as "
        "fine as DRRs are")
      .above(0.0)
      .finite()
      .excludes({"--st-nodes", "--target-psnr-db", "--max-field-size", "--max-drr-ms"})
      .not_recorded("the nodes that follow from it are");
  field("uv_samples",
        options.uv_samples,
        "What a viewpoint holds: point, its line integrals; or least-squares, fitted for "
        "interpolation, 1 dB better for 3 to 4.5 times the rays [the preset's, else point]")
      .one_of({"point", "least-squares"})
      .decides(kCastingStage);
  field("look_up",
        options.look_up,
        "How programs look DRRs up unless told otherwise; registrations replace cubic by cubic-sum "
        "[linear for the paper's design, else cubic]")
      .one_of({"linear", "cubic"})
      .not_deciding("samples and indices are the same");
  field("caster", options.caster, "How line integrals are made. " + caster_help())
      .one_of(caster_names())
      .decides(kCastingStage);
  field.part(options.ray_caster);
  Field& step = field.at("step_mm").decides(kCastingStage);
  step.help = "Trilinear caster: largest distance of samples along a ray, mm";
  field.part(options.attenuation);
  field.at("water_mu_per_mm").decides(kCastingStage);
  field("material",
        options.material,
        "Part of the CT in the field: all, or only bone, for a tube's spectrum (docs/spectra.md)")
      .one_of({"all", "bone"})
      .decides(kCastingStage);
  field("projections",
        options.projections,
        "study.toml of X-rays of known pose: what they show beyond the CT is added to the field "
        "(docs/measured-fields.md)")
      .input();
  field("projections_case", options.projections_case, "Case of --projections [the only one]")
      .needs({"--projections"})
      .input();
  field(
      "projections_smoothing_px",
      options.projections_smoothing_px,
      "Gaussian on the projections' difference from the CT, standard deviation in pixels; 0: none")
      .within(0.0, 100.0)
      .not_deciding("the hash of the projections says it");
  field("projections_common",
        options.projections_common,
        "Keep or remove what the projections' difference from the CT has at a pixel in all views, "
        "as errors of a detector have")
      .one_of({"keep", "remove"})
      .not_deciding("the hash of the projections says it");
}

std::uint64_t training_tiles_per_codeword(bool fits_uv) {
  return fits_uv ? kFewerTrainingTilesPerCodeword : kTrainingTilesPerCodeword;
}

void describe_codebook(Fields& field, PrecomputeOptions& options) {
  field(
      "codewords", options.codewords, "Size of the codebook, 2 to 65536 [the preset's, else 16384]")
      .decides(kCodebookStage);
  field("tile_coding",
        options.tile_coding,
        "What a codeword is: plain, the tile; or mean-removed, its difference from a mean kept "
        "beside it, 1 to 2 dB better [the preset's, else plain]")
      .one_of({"plain", "mean-removed"})
      .decides(kCodebookStage);
  field("mean_step",
        options.mean_step,
        "Means of mean-removed tiles are multiples of so many levels of 65535")
      .no_option("the preset's, or 64")
      .decides(kCodebookStage);
  field("tile_filter",
        options.tile_filter,
        "Correction of decoded tiles: none; or neighbours, by the tiles beside, 1 to 2 dB better, "
        "but programs hold 2 bytes per sample [the preset's, else none]")
      .one_of({"none", "neighbours"})
      .not_deciding("samples and indices are the same");
  field("training_fraction",
        options.training_fraction,
        "Share of the non-empty tiles that train the codebook; the paper's was 0.1 [64 or 32 tiles "
        "per codeword, at most a million]")
      .recorded_when_unset(
          "training_tiles_per_codeword",
          std::to_string(training_tiles_per_codeword(options.uv_samples == "least-squares")))
      .decides(kCodebookStage);
  field("max_training_tiles", options.max_training_tiles, "Most training tiles, whatever the share")
      .decides(kCodebookStage);
  field("seed", options.seed, "Seed of every random choice").decides(kCodebookStage);
}

bool is_key_and_value(const std::string& hint) {
  const std::size_t equals = hint.find('=');
  return equals != std::string::npos && equals != 0 && equals + 1 != hint.size();
}

void describe_run(Fields& field, PrecomputeOptions& options) {
  const char* const why = "every way of making it gives the same field";
  field("output", options.output, "The field file to write, FIELD.h5")
      .as("-o,--output")
      .not_deciding(why);
  field("memory_limit_bytes",
        options.memory_limit_bytes,
        "Memory of each rank beside the CT, e.g. 8GB; tiles that do not fit are read back or cast "
        "again [300 MiB]")
      .as("--memory-limit")
      .size()
      .default_in_help()
      .not_deciding(why);
  field("mpi_io_hints",
        options.mpi_io_hints,
        "KEY=VALUE, once per hint to MPI-IO (precompute/README.md) [MPI's own choice]")
      .as("--mpi-io-hint")
      .one_at_a_time()
      .of_form("KEY=VALUE", is_key_and_value)
      .not_deciding(why);
  field("dry_run",
        options.is_dry_run,
        "Print sizes, memory, compression, expected time and advice; write nothing")
      .not_recorded("it writes nothing");
  field(
      "restart", options.is_restart, "Discard unfinished work in FIELD.h5.progress and start over")
      .not_recorded(why);
  field("checkpoint",
        options.has_checkpoint,
        "Do not keep unfinished work in FIELD.h5.progress; tiles that do not fit are cast again")
      .as("--no-checkpoint")
      .off_switch()
      .not_deciding(why);
}

}  // namespace

void PrecomputeOptions::describe(Fields& field) {
  describe_source(field, *this);
  describe_casting(field, *this);
  describe_codebook(field, *this);
  describe_run(field, *this);
}

PrecomputeOptions PrecomputeOptions::in_force() const {
  if (needs_probe()) return *this;
  PrecomputeOptions options = with_design(design());
  options.st_plane = st_plane_rule() == StPlane::Centre ? "centre" : "centroid";
  return options;
}

DesignParts PrecomputeOptions::stated_parts() const {
  DesignParts parts{
      slabs, uv_nodes, st_nodes, codewords, look_up, std::nullopt, std::nullopt, std::nullopt};
  if (uv_samples) parts.fits_uv = *uv_samples == "least-squares";
  if (tile_filter) parts.filters_tiles = *tile_filter == "neighbours";
  if (tile_coding)
    parts.mean_step = *tile_coding == "plain" ? 0 : mean_step.value_or(kDefaultMeanStep);
  return parts;
}

const DesignPreset& PrecomputeOptions::design_preset() const {
  const bool has_parts = slabs || uv_nodes || st_nodes || st_spacing_mm || codewords ||
                         uv_samples || look_up || tile_coding || tile_filter;
  const char* const whole = is_atlas() ? kAtlasPreset : kDefaultPreset;
  return design_preset_named(preset.value_or(has_parts ? kPaperPreset : whole));
}

bool PrecomputeOptions::needs_probe() const {
  if (slabs && uv_nodes && (st_nodes || st_spacing_mm) && codewords) return false;
  return budget.is_stated() || design_preset().budget.is_stated();
}

const DesignBudget& PrecomputeOptions::limits() const {
  return budget.is_stated() ? budget : design_preset().budget;
}

double min_improvement_of(const FieldDesign& design) {
  return design.slabs == 1 ? CodebookOptions{}.min_relative_improvement : 0.015;
}

PrecomputeOptions PrecomputeOptions::with_st_nodes(int nodes) const {
  PrecomputeOptions options = *this;
  options.st_nodes = nodes;
  options.st_spacing_mm.reset();
  return options;
}

PrecomputeOptions PrecomputeOptions::with_design(const FieldDesign& design) const {
  PrecomputeOptions options = *this;
  options.slabs = design.slabs;
  options.uv_nodes = design.uv_nodes;
  options.st_nodes = design.st_nodes;
  options.codewords = design.codewords;
  // Fields without this option are for linear look-up.
  if (design.look_up == "linear")
    options.look_up.reset();
  else
    options.look_up = design.look_up;
  // Fields record how tiles are coded only where that differs from plain, or from the preset.
  options.tile_coding.reset();
  options.mean_step.reset();
  if (design.mean_step > 0) {
    options.tile_coding = "mean-removed";
    options.mean_step = design.mean_step;
  } else if (options.design().mean_step > 0) {
    options.tile_coding = "plain";
  }
  options.uv_samples.reset();
  if (design.fits_uv)
    options.uv_samples = "least-squares";
  else if (options.design().fits_uv)
    options.uv_samples = "point";
  options.tile_filter.reset();
  if (design.filters_tiles)
    options.tile_filter = "neighbours";
  else if (options.design().filters_tiles)
    options.tile_filter = "none";
  return options;
}

CodebookOptions PrecomputeOptions::codebook_options() const {
  CodebookOptions options;
  options.codewords = design().codewords;
  options.mean_step = design().mean_step;
  options.min_relative_improvement = min_improvement_of(design());
  options.seed = seed;
  return options;
}

StPlane PrecomputeOptions::st_plane_rule() const {
  if (!st_plane.has_value()) return design().slabs == 1 ? StPlane::Centre : StPlane::Centroid;
  return *st_plane == "centre" ? StPlane::Centre : StPlane::Centroid;
}

std::vector<std::string> problems(const PrecomputeOptions& options) {
  std::vector<std::string> found =
      problems(options.range());  // throws UsageError where it is no range
  if (!options.orbit.empty()) (void)orbit_of_text("--orbit", options.orbit);  // likewise
  append(field_problems(options), found);
  append(problems(options.codebook_options()), found);
  if (!options.projections.empty() && options.is_of_bone())
    found.push_back(
        "projections: must not be given with material = bone: X-rays show all that attenuates");
  append(problems(options.training_selection()), found);
  if (options.needs_probe() && options.uv_samples == "least-squares")
    found.emplace_back(
        "uv_samples = least-squares: a probe forecasts point samples alone; leave it out, or state "
        "slabs, uv_nodes, st_nodes and codewords instead of a limit");
  if (options.needs_probe() && options.tile_filter == "neighbours")
    found.emplace_back(
        "tile_filter = neighbours: a probe forecasts fields without one; leave it out, or state "
        "slabs, uv_nodes, st_nodes and codewords instead of a limit");
  if (options.needs_probe() && options.st_spacing_mm)
    found.emplace_back(
        "st_spacing_mm: a probe chooses the nodes of the (s,t) planes; leave it out, or state "
        "slabs, uv_nodes and codewords, too");
  const FieldDesign design = options.design();
  if (!options.needs_probe() && design.fits_uv && design.uv_nodes < kFewestFittedViewpoints)
    found.push_back("uv_nodes = " + std::to_string(design.uv_nodes) + ": must be at least " +
                    std::to_string(kFewestFittedViewpoints) + " with uv_samples = least-squares");
  if (!options.center_ct_mm.empty() && options.center_ct_mm.size() != 3)
    found.push_back("center_ct_mm has " + std::to_string(options.center_ct_mm.size()) +
                    " numbers: must be x,y,z");
  for (const double coordinate : options.center_ct_mm)
    if (!is_plausible_room_mm(coordinate))
      found.push_back("center_ct_mm = " + number_text(coordinate) + ": " + kPlausibleRoom);
  return found;
}

MotionRange PrecomputeOptions::range() const {
  MotionRange range(max_rotation_deg * kRadPerDeg, max_translation_mm);
  if (!rotation_range_deg.empty()) {
    const AxisRanges stated =
        axis_ranges("--rotation-range-deg", rotation_range_deg, 'r', max_rotation_deg);
    for (std::size_t i = 0; i < 3; ++i) {
      range.low.rotation_rad[static_cast<int>(i)] = stated.low[i] * kRadPerDeg;
      range.high.rotation_rad[static_cast<int>(i)] = stated.high[i] * kRadPerDeg;
    }
  }
  if (!translation_range_mm.empty()) {
    const AxisRanges stated =
        axis_ranges("--translation-range-mm", translation_range_mm, 't', max_translation_mm);
    for (std::size_t i = 0; i < 3; ++i) {
      range.low.translation_mm[static_cast<int>(i)] = stated.low[i];
      range.high.translation_mm[static_cast<int>(i)] = stated.high[i];
    }
  }
  return range;
}

TrainingSelection PrecomputeOptions::training_selection(int for_codewords) const {
  if (training_fraction) return {*training_fraction, max_training_tiles, seed};
  const std::uint64_t tiles =
      training_tiles_per_codeword(design().fits_uv) * static_cast<std::uint64_t>(for_codewords);
  return {kLargestTrainingFraction,
          std::min({max_training_tiles, tiles, kTrainingTilesUnlessStated}),
          seed};
}

}  // namespace af
