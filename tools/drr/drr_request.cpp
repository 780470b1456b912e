// SPDX-License-Identifier: Apache-2.0
#include "tools/drr/drr_request.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <sstream>

#include "base/error.h"
#include "ct/ct_reader.h"
#include "drr/bone_volume.h"
#include "drr/field_renderer.h"
#include "drr/opened_field.h"
#include "drr/ray_cast_drr.h"
#include "figures/picture.h"
#include "files/csv_table.h"
#include "files/output_file.h"
#include "files/resource_check.h"
#include "files/shell_words.h"
#include "geometry/camera_distance.h"
#include "ranks/root_only.h"
#include "ranks/terminal.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "study/study_file.h"
#include "xray/image_file.h"
#include "xray/psnr.h"

namespace af::tools {
namespace {

/// What DRRs are made from, and for which camera.
struct DrrSource {
  std::filesystem::path ct;  ///< empty: none
  CtReadOptions ct_reading;
  std::optional<CameraGeometry> camera;  ///< none: the field's
  std::optional<PoseFrame> frame;        ///< none: the field's, or that of the CT's centre
  Eigen::Vector3d isocenter_point = Eigen::Vector3d::Zero();
};

/// What renders, for which camera, and the frame of pose parameters.
struct DrrScene {
  DrrSource source;
  std::shared_ptr<const DrrRenderer> renderer;   ///< the field's, or else the ray caster
  std::shared_ptr<const DrrRenderer> reference;  ///< the ray caster, for --compare
  View view;
  PoseFrame frame;
  std::shared_ptr<ThreadPool> pool;
  std::optional<FieldIdentity> stated;  ///< that of the only field, looked up for its own camera
  /// How far the camera is from the field's own, or from the first field's if there are several.
  /// Empty for that camera itself.
  std::string note;
  std::vector<std::string> warnings;  ///< about the CT
};

void describe_source(Fields& field, DrrOptions& options) {
  field("field",
        options.field,
        "Look DRRs up in this field or atlas, through its own camera or one of --rig whose rays it "
        "holds")
      .stands_for(PathRole::InputFile, ".h5");
  field("also_field",
        options.more_fields,
        "A further field of the same CT for other angles or cameras; each pose uses the field that "
        "holds its rays best")
      .one_at_a_time();
  field("ct", options.ct, "Cast rays through this CT (DICOM folder, NIfTI, MetaImage, NRRD)")
      .stands_for(PathRole::InputVolume, ".nrrd");
  describe_beside_ct(field, options.ct_reading);
  field("study",
        options.study,
        "study.toml in place of --ct and --rig; poses are relative to its nominal pose")
      .stands_for(PathRole::InputFile, ".toml");
  field("study_case", options.study_case, "Case of the study [the only one]").as("--case");
  field("rig", options.rig, "Rig file, or c-arm-12in, or treatment-room");
  field("camera", options.camera, "Camera of the rig or study");
  field("look_up",
        options.look_up,
        "How DRRs are looked up [the field's own way]. " + field_look_up_help())
      .as("--look-up,--interpolation")
      .choice(field_look_up_names());
  field.part(options.attenuation);
  field.at("water_mu_per_mm").help =
      "Attenuation of water, 1/mm, for ray casting (with --compare the field's own)";
  field.part(options.ray_caster);
  field.part(options.beam);
}

void describe_pose(Fields& field, DrrOptions& options) {
  field("rotation_deg",
        options.rotation_deg,
        "rx,ry,rz about the room's axes, degrees, relative to the nominal pose: the field's, or "
        "the CT's centre at the rig's isocentre (default 0,0,0)");
  field("translation_mm",
        options.translation_mm,
        "tx,ty,tz along the room's axes, mm (default 0,0,0)");
  field("pose", options.pose, "File with one pose as TOML, JSON, CSV or ITK text (docs/poses.md)")
      .stands_for(PathRole::InputTransform, ".tfm");
  field("poses",
        options.poses,
        "CSV of poses (rx_deg ... tz_mm, or m00 ... m23) or another file of poses (docs/poses.md): "
        "one 3-D stack comes out")
      .stands_for(PathRole::InputFile, ".csv");
}

void describe_output(Fields& field, DrrOptions& options) {
  field("compare",
        options.compare,
        "Field, ray cast, difference and PSNR in one PNG (needs --field and --ct)");
  field("threads",
        options.threads,
        "Threads that share a large DRR, or the DRRs of --poses; 0: every processor");
  field("output",
        options.output,
        "OUT.mha, .nii.gz, .nrrd, .tif: total attenuation, float32; OUT.png: 8 bits, bright is "
        "attenuated")
      .as("-o,--output")
      .stands_for(PathRole::OutputVolume, ".nrrd")
      .required();
}

bool ends_with(const std::filesystem::path& path, const std::string& ending) {
  const std::string name = path.filename().string();
  return name.size() > ending.size() &&
         name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

bool is_known_format(const std::filesystem::path& path) {
  for (const char* ending : {".mha", ".nii.gz", ".nrrd", ".tif", ".png"})
    if (ends_with(path, ending)) return true;
  return false;
}

void append_source_problems(const DrrOptions& options, std::vector<std::string>& found) {
  const bool has_field = !options.field.empty();
  const bool has_study = !options.study.empty();
  const bool has_ct = !options.ct.empty() || has_study;
  if (has_study && !(options.ct.empty() && options.rig.empty()))
    found.emplace_back("--study = set: stands for --ct and --rig; leave these out");
  if (has_study && options.camera.empty()) found.emplace_back("--study = set: needs --camera");
  if (!has_study && !options.study_case.empty())
    found.push_back("--case = " + options.study_case + ": applies to --study only");
  if (options.compare && !(has_field && has_ct))
    found.emplace_back("--compare = set: needs --field, and --ct or --study");
  if (!options.compare && has_field == has_ct)
    found.push_back("source = " + std::string(has_field ? "--field and " : "none") +
                    (!has_field  ? ""
                     : has_study ? "--study"
                                 : "--ct") +
                    ": give --field, or --ct with --rig and --camera, or --study with --camera "
                    "(two only for --compare)");
  if (!has_field && !options.ct.empty() && (options.rig.empty() || options.camera.empty()))
    found.emplace_back("--ct = set: needs --rig and --camera");
  if (!has_study && options.rig.empty() != options.camera.empty())
    found.emplace_back("--rig, --camera = only one of them: give both");
  if (!has_field && !options.more_fields.empty())
    found.push_back("--also-field = " + options.more_fields.front() +
                    ": goes with --field, whose camera and poses are used");
  if (!has_field && !options.look_up.empty())
    found.push_back("--look-up = " + options.look_up + ": applies to fields only; give --field");
}

void append_pose_problems(const DrrOptions& options, std::vector<std::string>& found) {
  const bool has_parameters =
      options.rotation_deg.has_value() || options.translation_mm.has_value();
  const int ways =
      (has_parameters ? 1 : 0) + (options.pose.empty() ? 0 : 1) + (options.poses.empty() ? 0 : 1);
  if (ways > 1)
    found.emplace_back(
        "pose = given in several ways: use one of --rotation-deg/--translation-mm, --pose, "
        "--poses");
  for (const auto& values : {options.rotation_deg, options.translation_mm})
    if (values.has_value() &&
        !std::all_of(values->begin(), values->end(), [](double v) { return std::isfinite(v); }))
      found.emplace_back("pose = not finite: must be finite numbers");
  if (options.compare && !options.poses.empty())
    found.emplace_back("--compare = set: shows one pose, not --poses");
}

void append_output_problems(const DrrOptions& options, std::vector<std::string>& found) {
  const bool is_png = ends_with(options.output, ".png");
  if (!is_known_format(options.output))
    found.push_back("output = " + options.output.string() +
                    ": must end in .mha, .nii.gz, .nrrd, .tif or .png");
  if (is_png && !options.poses.empty())
    found.push_back("output = " + options.output.string() +
                    ": a stack of poses must be .mha, .nii.gz, .nrrd or .tif");
  if (options.compare && !is_png)
    found.push_back("output = " + options.output.string() + ": a comparison must be .png");
}

struct CastCt {
  std::shared_ptr<const DrrRenderer> renderer;
  Eigen::Vector3d center_ct_mm;
};

DrrSource source_of(const DrrOptions& options) {
  if (!options.study.empty()) {
    const Study study = read_study(options.study);
    const StudyCase& study_case = study.find_case(options.study_case);
    return {study_case.ct,
            study_case.ct_reading,
            study.rig.camera(options.camera),
            study_case.frame(),
            study.rig.isocenter_point};
  }
  if (options.rig.empty()) return {options.ct, options.ct_reading, {}, {}, {}};
  const CameraRig rig = read_rig(options.rig);
  return {options.ct, options.ct_reading, rig.camera(options.camera), {}, rig.isocenter_point};
}

std::shared_ptr<const DrrRenderer> cast_through(
    const std::shared_ptr<const AttenuationVolume>& volume,
    const DrrOptions& options,
    const std::shared_ptr<ThreadPool>& pool) {
  const auto caster = [&](std::shared_ptr<const AttenuationVolume> through) {
    return std::make_shared<const RayCastDrr>(std::move(through), options.ray_caster, pool);
  };
  const XrayBeam beam(options.beam, volume->model());
  return beam.renderer(caster(volume),
                       options.beam.needs_bone() ? caster(bone_volume(*volume)) : nullptr);
}

CastCt ray_caster(const DrrOptions& options,
                  const DrrSource& source,
                  const std::optional<FieldIdentity>& field,
                  const std::shared_ptr<ThreadPool>& pool,
                  std::vector<std::string>& warnings) {
  const CtVolume ct = read_ct(source.ct, source.ct_reading, &warnings);
  AttenuationModel model = options.attenuation;
  if (field.has_value()) {
    require_same_ct(options.field.string(), identity_of(ct), source.ct.string(), field->ct);
    // --compare compares ways to render, so the reference takes the field's HU model.
    model = {field->mu_water_per_mm, field->air_below_hu};
  }
  return {cast_through(std::make_shared<const AttenuationVolume>(ct, model), options, pool),
          ct.grid.center_mm()};
}

void require_same_subject(const FieldIdentity& wanted,
                          const FieldIdentity& found,
                          const std::string& path) {
  require_same_ct(path, wanted.ct, "that of --field", found.ct);
  if (found.mu_water_per_mm != wanted.mu_water_per_mm || found.air_below_hu != wanted.air_below_hu)
    throw InputError("--also-field",
                     path,
                     "must have the attenuation of --field: mu_water and the HU that count as air");
}

/// The field, or every member of an atlas, to be looked up in the beam's way. With a tube's
/// spectrum, it goes together with the field or atlas of the bone beside it.
std::vector<FieldSetMember> renderers_of(const OpenedField& opened,
                                         const DrrOptions& options,
                                         const std::shared_ptr<ThreadPool>& pool,
                                         const Communicator& communicator) {
  std::vector<FieldSetMember> members = opened.renderers(options.look_up, pool);
  std::shared_ptr<const DrrRenderer> bone;
  if (options.beam.needs_bone())
    bone = opened.bone(communicator)
               .renderer(options.look_up.empty() ? opened.info().look_up : options.look_up, pool);
  const FieldIdentity& identity = opened.identity();
  const XrayBeam beam(options.beam, {identity.mu_water_per_mm, identity.air_below_hu});
  for (FieldSetMember& member : members) member.renderer = beam.renderer(member.renderer, bone);
  return members;
}

/// The field's renderer. With further fields, or for an atlas, it is that of the set.
std::shared_ptr<const DrrRenderer> renderer_of(const OpenedField& first,
                                               const DrrOptions& options,
                                               const std::shared_ptr<ThreadPool>& pool,
                                               const Communicator& communicator) {
  std::vector<FieldSetMember> members = renderers_of(first, options, pool, communicator);
  for (const std::string& path : options.more_fields) {
    const OpenedField other(path, communicator);
    require_same_subject(first.identity(), other.identity(), path);
    for (FieldSetMember& member : renderers_of(other, options, pool, communicator))
      members.push_back(std::move(member));
  }
  if (members.size() == 1) return members.front().renderer;
  return std::make_shared<const FieldSetDrr>(std::move(members));
}

/// A note about the camera for which DRRs are looked up.
std::string note_of(const CameraGeometry& camera,
                    const CameraGeometry& of_field,
                    const DrrOptions& options) {
  const CameraDistance distance = camera_distance(camera, of_field);
  if (distance.is_none()) return "";
  return "camera " + camera.name + ": " + distance.text() +
         (options.more_fields.empty() ? "" : ", that of --field");
}

/// Collective. Reads field, CT and rig. Throws FileError when --compare's CT is not the field's.
DrrScene load_scene(const DrrOptions& options, const Communicator& communicator) {
  DrrScene scene;
  scene.pool = std::make_shared<ThreadPool>(thread_count(options.threads));
  std::optional<FieldIdentity> field;
  if (!options.field.empty()) {
    const OpenedField opened(options.field, communicator);
    field = opened.identity();
    scene.view = View::whole_detector(field->camera);
    scene.frame = field->frame;
    scene.renderer = renderer_of(opened, options, scene.pool, communicator);
    if (opened.field() && options.more_fields.empty()) scene.stated = field;
  }
  scene.source = source_of(options);
  const DrrSource& source = scene.source;
  if (source.camera.has_value()) {
    scene.view = View::whole_detector(*source.camera);
    if (field) scene.note = note_of(*source.camera, field->camera, options);
    if (!scene.note.empty()) scene.stated.reset();
  }
  if (source.frame.has_value())
    scene.frame = *source.frame;
  else if (!field)
    scene.frame.center_room_mm = source.isocenter_point;
  if (!source.ct.empty()) {
    const CastCt cast = ray_caster(options, source, field, scene.pool, scene.warnings);
    (field ? scene.reference : scene.renderer) = cast.renderer;
    if (!field && !source.frame.has_value()) scene.frame.center_ct_mm = cast.center_ct_mm;
  }
  return scene;
}

/// Poses in the order of the options or their file. `notes` receives what was left out and assumed.
std::vector<RigidTransform> requested_poses(const DrrOptions& options,
                                            const DrrScene& scene,
                                            std::vector<std::string>& notes) {
  const std::string& ct = scene.source.ct;
  const PoseContext context = {scene.frame, ct.empty() ? "" : "--ct " + shell_quoted(ct)};
  if (!options.poses.empty()) return read_poses(options.poses, context, &notes);
  if (!options.pose.empty()) return {read_pose(options.pose, context, &notes)};
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (options.rotation_deg.has_value()) values[i] = (*options.rotation_deg)[i];
    if (options.translation_mm.has_value()) values[i + 3] = (*options.translation_mm)[i];
  }
  return {pose_of_deg_and_mm(scene.frame, values, "--rotation-deg, --translation-mm")};
}

/// What is odd about poses that a field's stated range does not hold. Empty: nothing.
std::string range_note(const std::optional<FieldIdentity>& stated,
                       const std::vector<RigidTransform>& poses) {
  if (!stated) return "";
  std::size_t count = 0;
  std::string first;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const ParameterSet beyond = stated->range.beyond(parameters_from_pose(stated->frame, poses[i]));
    if (beyond.none()) continue;
    if (count++ == 0) first = "pose " + std::to_string(i) + " along " + parameter_names(beyond);
  }
  if (count == 0) return "";
  return std::to_string(count) + " of " + std::to_string(poses.size()) +
         " poses lie beyond the motion range that the field states, " + stated->range.text() +
         " (" + first + "): it was not made for them, though it may hold their rays";
}

/// Throws InputError when this many DRRs do not fit into memory, or on the disk of the output.
void require_room(std::size_t poses, const View& view, const std::filesystem::path& output) {
  const double bytes = static_cast<double>(poses) * static_cast<double>(view.pixel_count()) *
                       static_cast<double>(sizeof(float));
  // The DRRs themselves, one block for the writer, and what is read back to verify them.
  constexpr double kCopies = 3.0;
  require_memory(std::to_string(poses) + " DRRs", kCopies * bytes);
  const bool is_compressed = ends_with(output, ".gz") || ends_with(output, ".png");
  if (!is_compressed) require_disk_space(output, bytes);
}

/// DRRs of all poses, shared by the threads of the pool. Throws InputError, with `note`, when any
/// ray of any pose is outside the field.
std::vector<Image2d> render_poses(const DrrRenderer& renderer,
                                  const View& view,
                                  const std::vector<RigidTransform>& poses,
                                  ThreadPool& pool,
                                  const std::string& note) {
  std::vector<Image2d> drrs(poses.size());
  pool.for_each(static_cast<int>(poses.size()), [&](int task, int /*slot*/) {
    const auto i = static_cast<std::size_t>(task);
    std::int64_t rays_outside = 0;
    drrs[i] = render_image(renderer, poses[i], view, &rays_outside);
    if (rays_outside > 0)
      throw InputError("pose " + std::to_string(i) +
                       " = outside the field: " + RenderStatus{rays_outside}.text(view) +
                       "; must be within the motion range it was made for" +
                       (note.empty() ? "" : " (" + note + ")"));
  });
  return drrs;
}

/// The window of a PNG: all values but outliers.
std::array<double, 2> shown_window(const Image2d& image) {
  return percentile_window(image, 0.5, 99.5);
}

/// Writes one DRR, a stack of several, or a PNG, by the name's extension. Returns a line about it.
std::string write_drrs(const std::vector<Image2d>& drrs,
                       const View& view,
                       const DrrOptions& options) {
  const Eigen::Vector2d& spacing = view.camera.pixel_spacing_mm;
  std::ostringstream line;
  line << options.output.string() << ": " << drrs.front().width << " x " << drrs.front().height;
  if (ends_with(options.output, ".png")) {
    const auto [low, percentile] = shown_window(drrs.front());
    // A DRR of one value shows nothing, as when the CT is out of view.
    const double high = percentile > low ? percentile : low + 1.0;
    write_png_image(drrs.front(), options.output, low, high);
    line << (percentile > low ? "" : ", constant: the CT is out of view") << ", U "
         << fixed_text(low, 3) << " (black) to " << fixed_text(high, 3) << " (white)";
  } else if (options.poses.empty()) {
    write_image(drrs.front(), options.output, spacing.x(), spacing.y());
    line << ", total attenuation U as float32";
  } else {
    write_image_stack(drrs, options.output, spacing.x(), spacing.y());
    line << " x " << drrs.size() << ", total attenuation U as float32";
  }
  return line.str();
}

/// Writes field, ray cast and difference of one pose into one PNG. Returns the PSNR in words.
std::string write_comparison(const DrrScene& scene,
                             const RigidTransform& room_from_ct,
                             const std::filesystem::path& path) {
  const Image2d field =
      render_poses(*scene.renderer, scene.view, {room_from_ct}, *scene.pool, scene.note).front();
  const Image2d cast =
      render_poses(*scene.reference, scene.view, {room_from_ct}, *scene.pool, "").front();
  const std::optional<Psnr> quality = psnr(field.pixels, cast.pixels);
  Image2d difference = field;
  for (std::size_t i = 0; i < difference.pixels.size(); ++i) difference.pixels[i] -= cast.pixels[i];
  const auto window = shown_window(cast);
  const auto limits = shown_window(difference);
  const double largest = std::max({std::abs(limits[0]), std::abs(limits[1]), 1e-6});
  std::string words = "no pixel in the foreground";
  if (quality.has_value())
    words = "PSNR " + fixed_text(quality->psnr_db, 2) + " dB, RMS difference " +
            fixed_text(quality->rms_difference, 4) + ", largest U " +
            fixed_text(quality->reference_maximum, 2) + ", foreground " +
            fixed_text(100.0 * quality->foreground_fraction, 1) + " %";
  const std::string range = "U " + fixed_text(window[0], 2) + " to " + fixed_text(window[1], 2);
  const PicturePanel field_panel{field, window[0], window[1], "Field", range, {}, {}};
  const PicturePanel cast_panel{cast, window[0], window[1], "Ray cast", range, {}, {}};
  const PicturePanel difference_panel{difference,
                                      -largest,
                                      largest,
                                      "Field - ray cast",
                                      "+-" + fixed_text(largest, 4),
                                      PicturePanel::Colors::Diverging,
                                      {}};
  write_picture({field_panel, cast_panel, difference_panel},
                3,
                "Camera " + scene.view.camera.name + ": " + words,
                path,
                std::max(1, 384 / std::max(1, cast.width)));
  return words;
}

}  // namespace

void DrrOptions::describe(Fields& field_list) {
  describe_source(field_list, *this);
  describe_pose(field_list, *this);
  describe_output(field_list, *this);
}

std::vector<std::string> problems(const DrrOptions& options) {
  std::vector<std::string> found;
  append_source_problems(options, found);
  append_pose_problems(options, found);
  append_output_problems(options, found);
  for (const std::string& text : thread_problems(options.threads)) found.push_back(text);
  for (const std::string& text : field_problems(options)) found.push_back(text);
  return found;
}

void run_drr(const DrrOptions& options, const Communicator& world) {
  throw_if_any(problems(options));
  do_on_root(world, [&] { announce_output(options.output); });
  const DrrScene scene = load_scene(options, world);
  std::vector<std::string> notes = scene.warnings;
  const std::vector<RigidTransform> poses = requested_poses(options, scene, notes);
  if (const std::string text = range_note(scene.stated, poses); !text.empty())
    notes.push_back(text);
  for (const std::string& text : notes) warn(world, text);
  if (!world.is_root()) return;
  if (!scene.note.empty()) std::cout << scene.note << '\n';
  if (options.compare) {
    const std::string words = write_comparison(scene, poses.front(), options.output);
    std::cout << options.output.string() << ": " << words << '\n';
    return;
  }
  require_room(poses.size(), scene.view, options.output);
  const std::vector<Image2d> drrs =
      render_poses(*scene.renderer, scene.view, poses, *scene.pool, scene.note);
  const auto is_empty = [](const Image2d& drr) {
    return std::ranges::all_of(drr.pixels, [](float value) { return value == 0.0f; });
  };
  if (const auto first = std::ranges::find_if(drrs, is_empty); first != drrs.end())
    warn(world,
         std::to_string(std::ranges::count_if(first, drrs.end(), is_empty)) + " of " +
             std::to_string(drrs.size()) + " DRRs are empty, the first at pose " +
             std::to_string(first - drrs.begin()) +
             ": no ray meets the CT; check the pose and the camera");
  std::cout << write_drrs(drrs, scene.view, options) << '\n';
}

}  // namespace af::tools
