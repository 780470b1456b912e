// SPDX-License-Identifier: Apache-2.0
#include "register/case_loading.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"
#include "ct/blurred_volume.h"
#include "ct/ct_facts.h"
#include "drr/bone_volume.h"
#include "drr/field_level.h"
#include "drr/opened_field.h"
#include "drr/ray_cast_drr.h"
#include "files/csv_table.h"
#include "files/sha256.h"
#include "geometry/camera_distance.h"
#include "ranks/root_only.h"
#include "register/case_renderers.h"
#include "register/kept_fields.h"
#include "register/method/prepared_stage.h"
#include "register/problem/fiducial_mask.h"
#include "register/problem/pose_target.h"
#include "register/problem/target_region.h"
#include "study/ct_keys.h"
#include "study/node_ct.h"
#include "study/rig_file.h"
#include "study/target_place.h"
#include "study/xray_reader.h"

namespace af::registration {
namespace {

/// Half the side of the cube about the ROI centre that stands for the CT when it is not read.
constexpr double kAssumedCtHalfSideMm = 100.0;

/// Points of the target box whose mean motion tells whether a corrected pose stands still. 64 cells
/// give the mean over the box to a few percent.
constexpr int kTargetPointsPerAxis = 4;

std::filesystem::path field_path_of(const StudyCase& study_case,
                                    const StudyView& view,
                                    const CaseLoadOptions& options) {
  const auto given = options.field_paths.find(view.camera);
  if (given != options.field_paths.end()) return given->second;
  if (view.field.has_value()) return *view.field;
  throw InputError("case '" + study_case.name + "', view '" + view.camera +
                   "': field = none: give --field " + view.camera +
                   "=FIELD.h5, or the key `field` in the study, or --renderer=raycast");
}

void require_known_field_cameras(const StudyCase& study_case, const CaseLoadOptions& options) {
  const std::string known = joined(study_case.views, ", ", &StudyView::camera);
  for (const auto& given : options.field_paths) {
    const bool found =
        std::any_of(study_case.views.begin(), study_case.views.end(), [&](const StudyView& view) {
          return view.camera == given.first;
        });
    if (!found)
      throw InputError(
          "field", given.first + "=" + given.second.string(), "camera must be one of " + known);
  }
}

/// What rank 0 tells the others about a view's files.
struct ViewImages {
  Image2d xray;
  Image2d mask;

  auto members() { return std::tie(xray, mask); }
};

/// X-ray and mask of a view from their files. Hashes, notes and warnings go to `loaded`.
ViewImages read_images(const StudyView& study_view,
                       const CameraGeometry& camera,
                       LoadedCase& loaded) {
  ViewXray xray = loaded.xray_readers.emplace_back(study_view, camera).read();
  loaded.input_notes["xray " + study_view.camera] = xray.note;
  for (std::string& warning : xray.warnings) loaded.warnings.push_back(std::move(warning));
  const auto note_hash = [&](const char* kind, const std::filesystem::path& path) {
    loaded.inputs[kind + (" " + study_view.camera)] = sha256_of_file(path.string());
  };
  note_hash("xray", study_view.xray);
  if (study_view.mask) note_hash("mask", *study_view.mask);
  if (study_view.reading.flat) note_hash("flat", *study_view.reading.flat);
  if (study_view.reading.dark) note_hash("dark", *study_view.reading.dark);
  return {std::move(xray.attenuation), std::move(xray.mask)};
}

/// `fiducial_mask_px`: CaseLoadOptions::fiducial_mask_mm on the detector.
void set_images(ViewImages images,
                const StudyView& study_view,
                double fiducial_mask_px,
                RegistrationView& view) {
  view.xray = std::move(images.xray);
  view.mask = std::move(images.mask);
  view.mask_without_markers =
      mask_fiducials(view.mask, view.view.camera, study_view.fiducials_px, fiducial_mask_px);
}

/// Collective. The views without renderers. Rank 0 reads the images, and keeps hashes and notes.
std::vector<RegistrationView> read_views(const Study& study,
                                         const StudyCase& study_case,
                                         double fiducial_mask_mm,
                                         const Communicator& communicator,
                                         LoadedCase& loaded) {
  std::vector<RegistrationView> views;
  for (const StudyView& study_view : study_case.views) {
    RegistrationView view;
    view.view = all_or_none(communicator, [&] {
      return View{study.rig.camera(study_view.camera), study_view.roi};
    });
    const CameraGeometry& camera = view.view.camera;
    ViewImages images =
        on_root(communicator, [&] { return read_images(study_view, camera, loaded); })
            .share()
            .take();
    set_images(std::move(images),
               study_view,
               fiducial_mask_mm * camera.pixels_per_mm(study.rig.isocenter_point),
               view);
    views.push_back(std::move(view));
  }
  return views;
}

/// Hash of the study's entry for the case and the rig of its cameras, without the paths of files.
std::string case_sha256(const Study& study, const StudyCase& study_case) {
  Study one;
  one.rig = study.rig;
  one.cases = {study_case};
  StudyCase& only = one.cases.front();
  only.note.clear();
  only.ct.clear();
  for (StudyView& view : only.views) {
    view.xray.clear();
    view.field.reset();
    if (view.mask.has_value()) view.mask->clear();
    if (view.reading.flat.has_value()) view.reading.flat->clear();
    if (view.reading.dark.has_value()) view.reading.dark->clear();
  }
  const std::string text = study_to_toml(one, {}) + rig_to_toml(one.rig);
  return sha256_hex(std::as_bytes(std::span(text)));
}

/// Throws InputError unless rays are cast through the attenuation with which the field was made.
void require_same_attenuation(const FieldIdentity& field,
                              const CaseLoadOptions& options,
                              const std::string& path) {
  const auto text = [](double water, int air) {
    return number_text(water) + " per mm, air below " + std::to_string(air) + " HU";
  };
  const AttenuationModel& model = options.attenuation;
  if (options.correction_levels.empty() ||
      (model.mu_water_per_mm == field.mu_water_per_mm && model.air_below_hu == field.air_below_hu))
    return;
  throw InputError(
      "attenuation of water",
      text(model.mu_water_per_mm, model.air_below_hu),
      "with --correct it must be the field's, " + text(field.mu_water_per_mm, field.air_below_hu),
      path);
}

/// "as HU", or what differs from that.
std::string how(const CtReadOptions& reading) {
  const std::string text = reading.text();
  return text.empty() ? "as HU" : "with " + text;
}

/// Requires that the field belongs to the case's CT, and to the attenuation through which rays are
/// cast.
void require_field_of_case(const OpenedField& opened,
                           const StudyCase& study_case,
                           const CaseLoadOptions& options,
                           const std::optional<CtFacts>& ct) {
  const FieldIdentity& identity = opened.identity();
  const std::string path = opened.path().string();
  require_same_attenuation(identity, options, path);
  if (ct.has_value())
    require_same_ct(
        path,
        ct->identity,
        study_case.ct.string() + ", read " + how(study_case.ct_reading) +
            " (the field's: " + how(ct_reading_of(opened.info().provenance.options_toml)) + ")",
        identity.ct);
}

/// Collective. Gives rank 0's box to every rank, because processors may differ in its last bits.
MotionRange shared_box(const MotionRange& range, const Communicator& communicator) {
  const Shared<PoseParameters> high = on_root(communicator, [&] { return range.high; }).share();
  return {high->rotation_rad.x(), high->translation_mm.x()};
}

/// The camera of the views for which a field was made. None when it is another one.
const CameraGeometry* camera_of_field(const FieldIdentity& field,
                                      const std::vector<RegistrationView>& views) {
  for (const RegistrationView& view : views)
    if (camera_distance(view.view.camera, field.camera).is_none()) return &view.view.camera;
  return nullptr;
}

[[noreturn]] void refuse_rays(const OpenedField& opened,
                              const std::string& camera,
                              const ViewReach& reach,
                              const std::vector<RegistrationView>& views) {
  const std::string path = opened.path().string();
  if (const CameraGeometry* other = camera_of_field(opened.identity(), views);
      other != nullptr && other->name != camera)
    throw FileError(
        path, "this is the field of camera '" + other->name + "', not of camera '" + camera + "'");
  throw FileError(path,
                  "camera '" + camera + "' of the field",
                  "one that holds all rays of twice the study's region at the nominal pose",
                  std::to_string(reach.held) + " of " + std::to_string(reach.rays) +
                      " rays; the study's has " + reach.distance);
}

/// Collective. Sets the poses that a field covers for the view's camera, and returns a note about
/// them. The field's motion range holds only for its own camera. For another camera, or an atlas,
/// its rays decide.
std::string limit_to_rays(const OpenedField& opened,
                          const RegistrationProblem& problem,
                          const Communicator& communicator,
                          RegistrationView& view) {
  const PoseFrame nominal = problem.frame();
  const CameraGeometry& camera = view.view.camera;
  const FieldIdentity& identity = opened.identity();
  if (opened.field() && camera_distance(camera, identity.camera).is_none()) {
    view.limit = MotionLimit{identity.frame, identity.range};
    view.reach = view.limit;
    return opened.coverage().distance_text(camera) + ", " + identity.range.text();
  }
  ViewReach reach = all_or_none(communicator, [&] {
    ViewReach found = opened.coverage().reach(view.widest_view(), nominal, identity.range);
    if (found.held < found.rays) refuse_rays(opened, camera.name, found, problem.views);
    return found;
  });
  reach.box = shared_box(reach.box, communicator);
  view.reach = MotionLimit{nominal, reach.box};
  return reach.distance + "; " + reach.text(camera.name);
}

/// Collective. The field of a view, opened if need be, and checked against the case.
std::shared_ptr<const OpenedField> field_of_view(const std::string& path,
                                                 const std::string& camera,
                                                 const StudyCase& study_case,
                                                 const CaseLoadOptions& options,
                                                 const std::optional<CtFacts>& ct,
                                                 const Communicator& communicator) {
  std::shared_ptr<const OpenedField> field;
  if (const auto given = options.opened_fields.find(camera); given != options.opened_fields.end())
    field = given->second;
  else if (options.kept_fields)
    field = options.kept_fields->find(path);
  if (!field) field = std::make_shared<const OpenedField>(path, communicator);
  all_or_none(communicator, [&] { require_field_of_case(*field, study_case, options, ct); });
  if (options.kept_fields) options.kept_fields->add(path, field);
  return field;
}

/// Collective. The fields of all views. Hashes and notes go to `loaded`. Returns the attenuation
/// model that they share.
AttenuationModel use_fields(const StudyCase& study_case,
                            const CaseLoadOptions& options,
                            const Communicator& communicator,
                            const std::optional<CtFacts>& ct,
                            RegistrationProblem& problem,
                            LoadedCase& loaded) {
  CtIdentity of_first_field;
  AttenuationModel model;
  for (std::size_t i = 0; i < problem.views.size(); ++i) {
    RegistrationView& view = problem.views[i];
    const std::string path = all_or_none(communicator, [&] {
      return field_path_of(study_case, study_case.views[i], options).string();
    });
    const bool is_of_study = options.field_paths.count(view.view.camera.name) == 0;
    std::optional<OpenedField> bone;
    FieldRenderers renderers;
    const std::shared_ptr<const OpenedField> field =
        naming_study_line(is_of_study ? study_case.views[i].places : StudyPlaces(), "field", [&] {
          auto opened =
              field_of_view(path, view.view.camera.name, study_case, options, ct, communicator);
          if (options.beam.needs_bone()) bone = opened->bone(communicator);
          renderers =
              field_renderers(*opened, bone, problem.frame(), view.view, options, communicator);
          return opened;
        });
    const CtIdentity& of_field = field->identity().ct;
    if (i == 0) {
      of_first_field = of_field;
      model = {field->identity().mu_water_per_mm, field->identity().air_below_hu};
    }
    all_or_none(communicator, [&] {
      require_same_ct(path, of_first_field, "that of the first field", of_field);
    });
    const std::string name = "field " + view.view.camera.name;
    if (bone) loaded.inputs["bone " + name] = bone->info().payload_sha256;
    view.renderer = renderers.levels.front();
    view.sample_spacing_mm = node_spacing_mm(*field->coverage().planes.front());
    for (std::size_t level = 0; level < renderers.blur_sigma_mm.size(); ++level)
      view.coarse_levels.push_back({renderers.levels[level + 1], renderers.blur_sigma_mm[level]});
    loaded.input_notes[name] = limit_to_rays(*field, problem, communicator, view) +
                               "; level 0 is looked up by " + renderers.look_up;
    loaded.inputs[name] = field->info().payload_sha256;
  }
  return model;
}

/// Blur of a level in mm, averaged over the views.
double mean_blur_mm(const RegistrationProblem& problem, int level) {
  double sum = 0.0;
  for (const RegistrationView& view : problem.views)
    sum += view.coarse_levels[static_cast<std::size_t>(level) - 1].blur_sigma_mm;
  return sum / static_cast<double>(problem.views.size());
}

/// Collective. Adds ray casting beside the fields, at the levels that a correction needs.
void add_ray_casts(const CastVolumes& volumes,
                   const std::shared_ptr<const DrrRenderer>& renderer,
                   const CaseLoadOptions& options,
                   const Communicator& communicator,
                   RegistrationProblem& problem) {
  for (const int level : options.correction_levels) {
    const auto ray_cast =
        level == 0 ? renderer
                   : coarse_ray_cast(volumes, mean_blur_mm(problem, level), options, communicator);
    for (RegistrationView& view : problem.views) {
      view.ray_casts.resize(static_cast<std::size_t>(level) + 1);
      view.ray_casts.back() = ray_cast;
    }
  }
}

/// Collective. The CT's attenuation, for ray casting.
NodeCt read_node_ct(const StudyCase& study_case,
                    const CaseLoadOptions& options,
                    const Communicator& communicator,
                    std::vector<std::string>& warnings) {
  return naming_study_line(study_case.places, "ct", [&] {
    return read_ct_per_node(
        study_case.ct, study_case.ct_reading, options.attenuation, communicator, warnings);
  });
}

/// Whether ends are judged, and the target separately too. DRRs of another beam are no sums of the
/// target's DRRs and those of the rest.
bool asks_target(const CaseLoadOptions& options) {
  return options.judging_level > 0 && options.beam.is_ordinary();
}

/// Collective. Reads what fields are checked against, and the target box where ends are judged.
KnownCt read_known(const StudyCase& study_case,
                   const CaseLoadOptions& options,
                   const Communicator& communicator,
                   std::vector<std::string>& warnings) {
  auto known = on_root(communicator, [&] {
    return read_known_ct(
        study_case.ct,
        study_case.ct_reading,
        options.attenuation,
        asks_target(options) ? std::optional(study_case.target_box_ct) : std::nullopt,
        warnings);
  });
  return naming_study_line(
      study_case.places, "ct", [&] { return std::move(known).share().take(); });
}

/// The bone in a volume, which is what moves. All of the volume if bone is hardly any of what
/// attenuates.
std::shared_ptr<const AttenuationVolume> bone_or_all(const AttenuationVolume& volume) {
  constexpr double kLeastBone = 0.05;
  const auto sum = [](const AttenuationVolume& part) {
    return std::accumulate(part.voxels().begin(), part.voxels().end(), 0.0);
  };
  auto bone = bone_volume(volume);
  return sum(*bone) >= kLeastBone * sum(volume) ? bone
                                                : std::make_shared<AttenuationVolume>(volume);
}

/// Sets RegistrationView::target_casts of all views, from the CT within the target box.
void add_target_casts(VolumePart box, const AttenuationModel& model, RegistrationProblem& problem) {
  if (std::all_of(
          box.voxels.begin(), box.voxels.end(), [](std::uint16_t voxel) { return voxel == 0; }))
    return;
  const auto target = bone_or_all(
      AttenuationVolume(box.grid, model, SharedArray<std::uint16_t>(std::move(box.voxels))));
  std::map<double, std::shared_ptr<const DrrRenderer>> by_sigma_mm;
  for (RegistrationView& view : problem.views) {
    view.target_casts = {std::make_shared<const RayCastDrr>(target)};
    if (view.coarse_levels.empty()) continue;
    const double sigma_mm = view.coarse_levels.front().blur_sigma_mm;
    auto& blurred = by_sigma_mm[sigma_mm];
    if (!blurred)
      blurred = std::make_shared<const RayCastDrr>(
          blurred_volume(*target, sigma_mm),
          RayCasterOptions{std::max(RayCasterOptions().step_mm, 0.5 * sigma_mm)});
    view.target_casts.push_back(blurred);
  }
}

/// Makes the views' regions follow the target box. If the box lies partly behind a source, that
/// view's region stays in its place.
void follow_target(const StudyCase& study_case,
                   RegistrationProblem& problem,
                   std::vector<std::string>& warnings) {
  for (std::size_t i = 0; i < problem.views.size(); ++i) {
    RegistrationView& view = problem.views[i];
    const CameraGeometry& camera = view.view.camera;
    const auto box = projected_box(study_case.target_box_ct, problem.nominal_room_from_ct, camera);
    if (!box.has_value()) continue;
    std::optional<RegionOfInterest> stated;
    if (study_case.views[i].is_roi_stated) stated = view.view.roi;
    view.target_region = target_region_about(*box, stated, study_case.is_nominal_stated);
    const Eigen::Vector2d size_px = box->high_px - box->low_px;
    if ((size_px.array() > camera.size_px.array().cast<double>()).any())
      warnings.push_back(
          "target_box_ct_mm: at the nominal pose the target box is wider or higher "
          "than the beam of camera '" +
          camera.name + "': " + fixed_text(size_px.x(), 0) + " x " + fixed_text(size_px.y(), 0) +
          " pixels of " + std::to_string(camera.size_px.x()) + " x " +
          std::to_string(camera.size_px.y()) + "; what lies beyond the detector is not compared");
  }
}

}  // namespace

const char* to_string(RendererKind kind) {
  return kind == RendererKind::Field ? "field" : "raycast";
}

LoadedCase load_case(const Study& study,
                     const StudyCase& study_case,
                     const CaseLoadOptions& options,
                     const Communicator& communicator) {
  LoadedCase loaded;
  if (options.kept_fields) options.kept_fields->begin_case(study_case);
  auto problem = std::make_shared<RegistrationProblem>();
  problem->case_name = study_case.name;
  problem->nominal_room_from_ct = study_case.nominal_room_from_ct;
  problem->center_ct_mm = study_case.center_ct_mm;
  problem->isocenter_point = study.rig.isocenter_point;
  all_or_none(communicator, [&] {
    require_known_field_cameras(study_case, options);
    loaded.inputs["case"] = case_sha256(study, study_case);
  });
  problem->views = read_views(study, study_case, options.fiducial_mask_mm, communicator, loaded);

  problem->target_box_ct = study_case.target_box_ct;
  problem->target_points_ct = ct_lattice_points(study_case.target_box_ct, kTargetPointsPerAxis);
  if (options.region_follows_target) follow_target(study_case, *problem, loaded.warnings);
  const bool looks_up = options.renderer == RendererKind::Field;
  std::optional<CtFacts> ct;
  AttenuationModel model = options.attenuation;
  VolumePart target;
  CastVolumes volumes;
  std::shared_ptr<const DrrRenderer> ray_cast;
  if (!looks_up || !options.correction_levels.empty()) {
    const NodeCt node_ct = read_node_ct(study_case, options, communicator, loaded.warnings);
    ct = node_ct.facts;
    if (asks_target(options))
      target = all_or_none(communicator,
                           [&] { return part_within(*node_ct.volume, study_case.target_box_ct); });
    problem->attenuating_points_ct = ct_lattice_points(node_ct.volume->grid_without_border());
    volumes = cast_volumes(node_ct.volume, options, communicator);
    ray_cast = ray_cast_through(volumes, options.ray_caster, options);
  } else if (!options.skip_ct_check) {
    KnownCt known = read_known(study_case, options, communicator, loaded.warnings);
    ct = std::move(known.facts);
    target = std::move(known.part);
  }
  if (ct.has_value())
    all_or_none(communicator, [&] { require_target_in_ct(study_case, ct->grid); });
  if (looks_up) {
    model = use_fields(study_case, options, communicator, ct, *problem, loaded);
    if (volumes.all) add_ray_casts(volumes, ray_cast, options, communicator, *problem);
  } else {
    const auto levels = coarse_ray_casts(volumes, options, communicator);
    for (RegistrationView& view : problem->views) {
      view.renderer = ray_cast;
      view.sample_spacing_mm = ct->grid.spacing_mm.mean();
      view.coarse_levels = levels;
    }
  }

  all_or_none(communicator, [&] {
    add_target_casts(std::move(target), model, *problem);
    for (RegistrationView& view : problem->views) view.drr_range = drr_range_of(*problem, view);
  });

  if (ct.has_value()) {
    loaded.inputs["ct"] = ct->identity;
    loaded.input_notes["ct"] = "read " + how(study_case.ct_reading);
    problem->scaling_points_ct = ct_lattice_points(ct->grid);
    problem->cut_points_ct = ct->cut_points_ct;
    problem->ct_grid = ct->grid;
  } else {
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(kAssumedCtHalfSideMm);
    problem->scaling_points_ct =
        ct_lattice_points(CtBox{study_case.center_ct_mm - half, study_case.center_ct_mm + half});
    loaded.warnings.emplace_back(
        "the CT is not read: whether the fields were made from it is not checked, and the steps "
        "are scaled as if it filled 200 mm about the ROI centre");
  }
  loaded.problem = std::move(problem);
  return loaded;
}

std::shared_ptr<const RegistrationProblem> with_xrays(const RegistrationProblem& problem,
                                                      std::span<ViewXrayReader> readers,
                                                      double fiducial_mask_mm,
                                                      std::map<std::string, Image2d> xrays,
                                                      std::vector<std::string>& warnings) {
  auto changed = std::make_shared<RegistrationProblem>(problem);
  for (auto& [name, values] : xrays) {
    std::size_t i = 0;
    while (i < readers.size() && readers[i].view().camera != name) ++i;
    if (i == readers.size())
      throw InputError(
          "camera",
          "'" + name + "'",
          "must be one of " + joined(problem.views, ", ", [](const RegistrationView& view) {
            return view.view.camera.name;
          }));
    ViewXray xray = readers[i].prepared(std::move(values));
    for (std::string& warning : xray.warnings) warnings.push_back(std::move(warning));
    RegistrationView& view = changed->views[i];
    set_images({std::move(xray.attenuation), std::move(xray.mask)},
               readers[i].view(),
               fiducial_mask_mm * view.view.camera.pixels_per_mm(problem.isocenter_point),
               view);
  }
  return changed;
}

}  // namespace af::registration
