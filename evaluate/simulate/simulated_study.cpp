// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/simulated_study.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/progress.h"
#include "ct/ct_reader.h"
#include "evaluate/simulate/automatic_target.h"
#include "evaluate/simulate/calibration_error.h"
#include "evaluate/simulate/ct_degradation.h"
#include "evaluate/simulate/moved_bone.h"
#include "evaluate/simulate/phantom.h"
#include "evaluate/simulate/simulate_options.h"
#include "evaluate/simulate/simulated_scan.h"
#include "evaluate/simulate/xray_simulator.h"
#include "figures/picture.h"
#include "files/csv_table.h"
#include "files/input_guard.h"
#include "files/options_toml.h"
#include "files/output_file.h"
#include "files/partial_folder.h"
#include "geometry/fiducial_registration.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "ranks/progress_printer.h"
#include "ranks/provenance.h"
#include "ranks/terminal.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "study/study_file.h"
#include "xray/dicom_xray_writer.h"
#include "xray/image_file.h"

namespace af::tools {

namespace {

/// Standard deviation of fiducial detections in column and row.
constexpr double kFiducialSigmaPx = 0.2;

/// A bone that X-rays show at another place than the CT does.
struct MovedBone {
  std::string name;
  RigidTransform rest_from_bone;
  double displacement_mm;  ///< mean over the target box
  std::string text;        ///< in words
};

/// A case before its X-rays are taken: where the patient lies and what is to be found.
struct SimulatedCase {
  StudyCase study_case;  ///< without file names; gold_room_from_ct is the true pose
  /// Pose of everything but the moved bone, whose pose is gold_room_from_ct.
  RigidTransform rest_room_from_ct = RigidTransform::Identity();
  std::optional<MovedBone> moved_bone;
  PoseParameters true_offset;            ///< of the true pose, relative to the nominal one
  CameraRig true_rig;                    ///< takes the X-rays; the study's own rig may differ
  std::vector<SteelCylinder> fiducials;  ///< as the CT has them
  SteelBodies occluders;                 ///< in the X-rays only, besides the fiducials
  std::vector<std::vector<Eigen::Vector2d>> exact_fiducials_px;  ///< per view, without noise
  std::optional<FiducialGold> fiducial_gold;
};

template <typename Vector>
std::string toml_array(const Vector& vector) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < vector.size(); ++i)
    text += (i > 0 ? ", " : "") + number_text(vector[i]);
  return text + "]";
}

template <typename Vector>
std::string toml_rows(const std::vector<Vector>& vectors) {
  std::string text = "[";
  for (std::size_t i = 0; i < vectors.size(); ++i)
    text += (i > 0 ? ", " : "") + toml_array(vectors[i]);
  return text + "]";
}

RegistrationTarget chosen_target(const SimulateOptions& options, const CtVolume& ct) {
  const auto& box = options.target_box_ct_mm;
  const auto& center = options.center_ct_mm;
  RegistrationTarget target;
  if (box.size() == 6) {
    target.box_ct = {{box[0], box[1], box[2]}, {box[3], box[4], box[5]}};
    target.center_ct_mm = 0.5 * (target.box_ct.low_mm + target.box_ct.high_mm);
  } else if (center.size() == 3) {
    target = target_box_at({center[0], center[1], center[2]}, kTargetSideMm);
  } else {
    target = options.phantom.empty() ? find_target(ct) : phantom_of(options).target;
  }
  if (center.size() == 3) target.center_ct_mm = {center[0], center[1], center[2]};
  return target;
}

void refuse_center_outside(const CtGrid& grid, const Eigen::Vector3d& center_ct_mm) {
  const Eigen::Vector3d index = grid.index_of(center_ct_mm);
  const Eigen::Vector3d last(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
  if ((index.array() < 0.0).any() || (index.array() > last.array()).any())
    throw InputError("center_ct_mm", toml_array(center_ct_mm), "must lie within the CT");
}

PoseParameters drawn_offset(const SimulateOptions& options, const std::string& case_name) {
  HashRandom random(options.seed, hash_name(case_name), hash_name("true pose"));
  const double angle = options.max_offset_rotation_deg * kRadPerDeg;
  const double shift = options.max_offset_translation_mm;
  PoseParameters offset;
  for (int axis = 0; axis < 3; ++axis) offset.rotation_rad[axis] = random.uniform(-angle, angle);
  for (int axis = 0; axis < 3; ++axis) offset.translation_mm[axis] = random.uniform(-shift, shift);
  return offset;
}

void refuse_source_inside(const CameraGeometry& camera,
                          const RigidTransform& room_from_ct,
                          const CtGrid& attenuating_grid) {
  const Eigen::Vector3d index =
      attenuating_grid.index_of(room_from_ct.inverse() * camera.source_point);
  const Eigen::Vector3d size(
      attenuating_grid.size[0], attenuating_grid.size[1], attenuating_grid.size[2]);
  if ((index.array() > -0.5).all() && (index.array() < size.array() - 0.5).all())
    throw InputError("camera '" + camera.name + "': its X-ray source lies inside the CT");
}

void refuse_pins_off_detector(const CameraGeometry& camera,
                              const std::vector<Eigen::Vector2d>& exact_px) {
  for (const Eigen::Vector2d& pixel : exact_px)
    if ((pixel.array() < 0.0).any() ||
        (pixel.array() > camera.size_px.cast<double>().array() - 1.0).any())
      throw InputError("a fiducial projects to " + toml_array(pixel) +
                       ", off the detector of camera '" + camera.name +
                       "': choose another --center-ct-mm or rig, or --no-fiducials");
}

/// Seed of one view's random numbers.
std::uint64_t view_key(const std::string& case_name, const std::string& camera, const char* what) {
  return hash64(hash_name(case_name), hash_name(camera), hash_name(what));
}

void add_fiducials(const SimulateOptions& options,
                   const CtVolume& ct,
                   const CameraRig& rig,
                   SimulatedCase& simulated) {
  StudyCase& study_case = simulated.study_case;
  simulated.fiducials = place_fiducials(ct, study_case.center_ct_mm);
  for (const SteelCylinder& pin : simulated.fiducials)
    study_case.fiducials_ct_mm.push_back(pin.center_point);
  std::vector<FiducialView> views;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const CameraGeometry& camera = simulated.true_rig.cameras[i];
    const auto detected = [&](double sigma_px) {
      return detect_fiducials(camera,
                              *study_case.gold_room_from_ct,
                              simulated.fiducials,
                              sigma_px,
                              options.seed,
                              view_key(study_case.name, camera.name, "fiducials"));
    };
    simulated.exact_fiducials_px.push_back(detected(0.0));
    refuse_pins_off_detector(camera, simulated.exact_fiducials_px.back());
    study_case.views[i].fiducials_px = detected(kFiducialSigmaPx);
    // An evaluation knows only the study's cameras.
    views.push_back({rig.cameras[i], study_case.views[i].fiducials_px});
  }
  if (views.size() >= 2)
    simulated.fiducial_gold = gold_from_fiducials(views, study_case.fiducials_ct_mm);
}

/// The cameras as they really are.
CameraRig true_rig(const SimulateOptions& options,
                   const CameraRig& rig,
                   const StudyCase& study_case) {
  CameraRig result = rig;
  if (!options.stress.has(Stress::Calibration)) return result;
  for (CameraGeometry& camera : result.cameras)
    camera = camera_with_calibration_error(camera,
                                           *study_case.gold_room_from_ct,
                                           study_case.target_box_ct,
                                           kCalibrationErrorPx,
                                           options.seed,
                                           view_key(study_case.name, camera.name, "calibration"));
  return result;
}

/// The pins where X-rays show them. They move with the moved bone.
std::vector<SteelCylinder> imaged_fiducials(const SimulatedCase& simulated) {
  std::vector<SteelCylinder> pins = simulated.fiducials;
  if (!simulated.moved_bone) return pins;
  const RigidTransform& rest_from_bone = simulated.moved_bone->rest_from_bone;
  for (SteelCylinder& pin : pins) {
    pin.center_point = rest_from_bone * pin.center_point;
    pin.axis_direction = rest_from_bone.linear() * pin.axis_direction;
  }
  return pins;
}

void add_occluders(const SimulateOptions& options, const CameraRig& rig, SimulatedCase& simulated) {
  const StudyCase& study_case = simulated.study_case;
  const StressOptions& stress = options.stress;
  std::vector<View> views;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i)
    views.push_back({rig.cameras[i], study_case.views[i].roi});
  const OccluderSite site =
      occluder_site(views, simulated.rest_room_from_ct, study_case.center_ct_mm);
  const auto key = [&](const char* what) { return view_key(study_case.name, "", what); };
  if (stress.has(Stress::Rods))
    simulated.occluders.cylinders = place_rods(site, {}, options.seed, key("rods"));
  if (stress.has(Stress::Fiducials))
    simulated.occluders.balls =
        place_balls(site, imaged_fiducials(simulated), {}, options.seed, key("balls"));
}

/// The X-ray as people look at it: bone bright, the window over the middle 98 % of the pixels.
void write_preview(const Image2d& xray, double open_beam_level, const std::filesystem::path& path) {
  Image2d attenuation = xray;
  for (float& value : attenuation.pixels) {
    constexpr double kHalfALevel = 0.5;
    const double level = std::max(static_cast<double>(value), kHalfALevel);
    value = static_cast<float>(-std::log(level / open_beam_level));
  }
  const auto [low, high] = percentile_window(attenuation);
  write_png_image(attenuation, path, low, std::max(high, low + 1e-6));
}

std::string cylinder_text(const std::string& table, const SteelCylinder& cylinder) {
  return "\n[[" + table + "]]                     # steel cylinder, ct frame\ncenter_ct_mm = " +
         toml_array(cylinder.center_point) + "\naxis_ct = " + toml_array(cylinder.axis_direction) +
         "\nradius_mm = " + number_text(cylinder.radius_mm) +
         "\nlength_mm = " + number_text(cylinder.length_mm) + "\n";
}

/// What was simulated, in one line for people.
std::string note_text(const SimulateOptions& options, const SimulatedCase& simulated) {
  std::string text = "X-rays simulated by af-simulate from ";
  text += options.phantom.empty() ? "a CT" : "the " + options.phantom + " phantom";
  if (options.phantom_options.has_metal) text += " with metal";
  if (options.phantom_options.anatomy_seed) {
    text += ", patient " + std::to_string(*options.phantom_options.anatomy_seed);
    for (const std::string& finding : phantom_of(options).findings) text += ", " + finding;
  }
  if (options.images_bodies()) text += "; X-rays of the bodies themselves, voxels in the CT only";
  if (simulated.moved_bone) text += "; " + simulated.moved_bone->text;
  const std::vector<StressDescription> stress = descriptions(options.stress);
  if (stress.empty()) return text;
  text += ", made harder by";
  for (std::size_t i = 0; i < stress.size(); ++i)
    text += (i == 0 ? " " : "; ") + stress[i].name + " (" + stress[i].text + ")";
  return text;
}

std::string truth_text(const SimulatedCase& simulated) {
  const StudyCase& study_case = simulated.study_case;
  const auto offset = simulated.true_offset.deg_and_mm();
  std::string text =
      "# The pose the X-rays of case \"" + study_case.name +
      "\" were simulated with, and the one that its fiducial detections give.\n" +
      pose_to_toml(*study_case.gold_room_from_ct) + "\n# relative to the nominal pose, about " +
      "center_ct_mm\nrotation_deg = " +
      toml_array(Eigen::Vector3d(offset[0], offset[1], offset[2])) +
      "\ntranslation_mm = " + toml_array(Eigen::Vector3d(offset[3], offset[4], offset[5])) + "\n";
  if (simulated.moved_bone) {
    text += "\n[moved_bone]                     # whose pose that is\nname = \"" +
            simulated.moved_bone->name +
            "\"\ndisplacement_mm = " + number_text(simulated.moved_bone->displacement_mm) +
            "          # mean over the target box\n" +
            "\n[rest]                           # all but the bone\n" +
            pose_to_toml(simulated.rest_room_from_ct);
  }
  if (simulated.fiducial_gold) {
    text += "\n[fiducial_gold]\n" + pose_to_toml(simulated.fiducial_gold->room_from_ct) +
            "\nfre_mm = " + number_text(simulated.fiducial_gold->fit.fre_mm) + "\n";
  }
  for (const SteelCylinder& pin : simulated.fiducials) text += cylinder_text("fiducial", pin);
  for (const SteelCylinder& rod : simulated.occluders.cylinders) text += cylinder_text("rod", rod);
  for (const SteelBall& ball : simulated.occluders.balls)
    text += "\n[[ball]]                         # steel, ct frame\ncenter_ct_mm = " +
            toml_array(ball.center_point) + "\nradius_mm = " + number_text(ball.radius_mm) + "\n";
  for (std::size_t i = 0; i < simulated.exact_fiducials_px.size(); ++i)
    text += "\n[[view]]\ncamera = \"" + study_case.views[i].camera +
            "\"\nexact_fiducials_px = " + toml_rows(simulated.exact_fiducials_px[i]) + "\n";
  return text;
}

/// Draws the true pose and, if requested, a bone's motion relative to the rest.
void draw_poses(const SimulateOptions& options, const PoseFrame& frame, SimulatedCase& simulated) {
  StudyCase& study_case = simulated.study_case;
  simulated.true_offset = drawn_offset(options, study_case.name);
  simulated.rest_room_from_ct = pose_from_parameters(frame, simulated.true_offset);
  study_case.gold_room_from_ct = simulated.rest_room_from_ct;
  const std::string& bone = options.moved_bone;
  if (bone.empty()) return;
  const CtBox& box = study_case.target_box_ct;
  const Eigen::Vector3d middle = 0.5 * (box.low_mm + box.high_mm);
  const RigidTransform still = RigidTransform::Identity();
  const RigidTransform rest_from_bone =
      drawn_rest_from_bone(phantom_of(options),
                           bone,
                           middle,
                           options.seed,
                           view_key(study_case.name, "", ("moved " + bone).c_str()));
  study_case.gold_room_from_ct = simulated.rest_room_from_ct * rest_from_bone;
  simulated.true_offset = parameters_from_pose(frame, *study_case.gold_room_from_ct);
  const double displacement_mm = mean_tre_mm(rest_from_bone, still, target_points(box));
  simulated.moved_bone = {
      bone,
      rest_from_bone,
      displacement_mm,
      bone + " turned by " +
          fixed_text(rotation_angle_between_rad(still, rest_from_bone) * kDegPerRad, 1) +
          " deg and moved by " + fixed_text((rest_from_bone * middle - middle).norm(), 1) +
          " mm against the rest (" + fixed_text(displacement_mm, 1) +
          " mm over the target box) in the X-rays, not in the CT"};
}

/// Chooses target, regions, true pose, true cameras, fiducials and occluders. Throws InputError
/// when the target or a fiducial misses a detector, or a source lies inside the CT.
SimulatedCase plan_case(const SimulateOptions& options,
                        const CtVolume& ct,
                        const CameraRig& rig,
                        const AttenuationVolume& volume) {
  SimulatedCase simulated;
  StudyCase& study_case = simulated.study_case;
  const RegistrationTarget target = chosen_target(options, ct);
  refuse_center_outside(ct.grid, target.center_ct_mm);
  study_case.name = options.case_name_in_force();
  study_case.center_ct_mm = target.center_ct_mm;
  study_case.target_box_ct = target.box_ct;

  PoseFrame frame;
  frame.center_ct_mm = target.center_ct_mm;
  frame.center_room_mm = rig.isocenter_point;
  study_case.nominal_room_from_ct = frame.nominal_room_from_ct();
  draw_poses(options, frame, simulated);

  for (const CameraGeometry& camera : rig.cameras) {
    refuse_source_inside(camera, simulated.rest_room_from_ct, volume.grid());
    const Eigen::Vector2i wanted_px = options.roi_px.size() == 2
                                          ? Eigen::Vector2i(options.roi_px[0], options.roi_px[1])
                                          : default_region_size_px(camera);
    StudyView view;
    view.camera = camera.name;
    view.roi = target_region(camera, study_case.nominal_room_from_ct, target, wanted_px);
    study_case.views.push_back(view);
  }
  simulated.true_rig = true_rig(options, rig, study_case);
  if (!options.omits_fiducials) add_fiducials(options, ct, rig, simulated);
  add_occluders(options, rig, simulated);
  study_case.note = note_text(options, simulated);
  return simulated;
}

std::optional<SmoothMotion> wanted_motion(const SimulateOptions& options,
                                          const SimulatedCase& simulated) {
  if (!options.stress.has(Stress::Motion)) return std::nullopt;
  SmoothMotionOptions motion;
  motion.threads = options.xray.threads;
  const StudyCase& study_case = simulated.study_case;
  CtBox still_box = study_case.target_box_ct;
  if (simulated.moved_bone) {  // where it is now
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& corner : still_box.corner_points())
      box.extend(simulated.moved_bone->rest_from_bone * corner);
    still_box = {box.min(), box.max()};
  }
  return SmoothMotion(still_box, motion, options.seed, view_key(study_case.name, "", "motion"));
}

SteelBodies all_steel(const SimulatedCase& simulated) {
  SteelBodies steel = simulated.occluders;
  const std::vector<SteelCylinder> pins = imaged_fiducials(simulated);
  steel.cylinders.insert(steel.cylinders.end(), pins.begin(), pins.end());
  return steel;
}

/// The simulator of this case's X-rays from voxels. `volume` must outlive it.
XraySimulator voxel_simulator(const SimulateOptions& options,
                              const AttenuationVolume& volume,
                              const SimulatedCase& simulated) {
  return {volume, all_steel(simulated), options.xray_in_force()};
}

/// The simulator of this case's X-rays from a phantom's bodies themselves, with the requested
/// motions.
XraySimulator body_simulator(const SimulateOptions& options,
                             const Phantom& phantom,
                             const SimulatedCase& simulated) {
  return {simulated.moved_bone
              ? with_moved_bone(phantom, options.moved_bone, simulated.moved_bone->rest_from_bone)
              : phantom,
          wanted_motion(options, simulated),
          options.attenuation,
          all_steel(simulated),
          options.xray_in_force()};
}

/// What voxels show: the anatomy itself, or the anatomy with the requested non-rigid motion.
CtVolume imaged_anatomy(const SimulateOptions& options,
                        const CtVolume& anatomy,
                        const SimulatedCase& simulated) {
  const std::optional<SmoothMotion> motion = wanted_motion(options, simulated);
  return motion ? motion->moved(anatomy) : anatomy;
}

/// The study's CT if it differs from the input: a degraded one, on request.
std::optional<CtVolume> degraded_study_ct(const SimulateOptions& options,
                                          const CtVolume& ct,
                                          const SimulatedCase& simulated) {
  if (!options.stress.has(Stress::DegradedCt)) return std::nullopt;
  CtDegradationOptions degradation;
  degradation.threads = options.xray.threads;
  return degraded_ct(ct,
                     degradation,
                     options.attenuation.air_below_hu,
                     options.seed,
                     view_key(simulated.study_case.name, "", "ct noise"));
}

/// Writes the X-ray's file into `folder`, and its path into `view`.
void write_xray(const SimulateOptions& options,
                const Image2d& xray,
                const CameraGeometry& camera,
                const Eigen::Vector3d& isocenter_point,
                const std::filesystem::path& folder,
                const StudyCase& study_case,
                StudyView& view) {
  const int bits = options.xray_in_force().detector.bits;
  if (options.xray_format == "dicom") {
    DicomXrayDescription description;
    description.stored_bits = bits;
    description.patient_id = study_case.name;
    description.description = "camera " + camera.name;
    description.imager_spacing_mm = camera.pixel_spacing_mm;
    description.source_detector_mm = camera.source_detector_distance_mm();
    description.source_patient_mm = (isocenter_point - camera.source_point).norm();
    const Eigen::Matrix3d ct_from_room = study_case.nominal_room_from_ct.linear().transpose();
    description.column_direction_ct = ct_from_room * camera.column_direction;
    description.row_direction_ct = ct_from_room * camera.row_direction;
    const Eigen::Vector2d angles = positioner_angles_deg(ct_from_room * camera.beam_direction());
    description.primary_angle_deg = angles.x();
    description.secondary_angle_deg = angles.y();
    view.xray = folder / (camera.name + ".dcm");
    write_dicom_xray(xray, view.xray, description);
    return;
  }
  view.xray = folder / (camera.name + ".mha");
  const auto write = bits == 0 ? write_image : write_image_u16;
  write(xray, view.xray, camera.pixel_spacing_mm.x(), camera.pixel_spacing_mm.y());
}

/// Takes the X-ray of every view, writes it with its preview into `folder`, and fills in the names
/// of the files.
void take_xrays(const SimulateOptions& options,
                const XraySimulator& simulator,
                const std::filesystem::path& folder,
                SimulatedCase& simulated,
                const ProgressCallback& progress) {
  StudyCase& study_case = simulated.study_case;
  const XraySimulationOptions imaging = options.xray_in_force();
  const CameraRig& rig = simulated.true_rig;
  const auto camera_count = static_cast<double>(rig.cameras.size());
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const CameraGeometry& camera = rig.cameras[i];
    StudyView& view = study_case.views[i];
    const Image2d xray =
        simulator.xray({camera, view.roi},
                       simulated.rest_room_from_ct,
                       options.seed,
                       view_key(study_case.name, camera.name, "photons"),
                       [&](double done, double total) {
                         if (progress)
                           progress(static_cast<double>(i) + done / total, camera_count);
                       });
    write_xray(options, xray, camera, rig.isocenter_point, folder, study_case, view);
    write_preview(xray, imaging.detector.open_beam_level, folder / (camera.name + "-preview.png"));
  }
}

/// Writes study.toml, rig.toml, truth.toml, rig-true.toml if it differs, provenance.json and
/// reproduce.sh.
void write_study_files(const SimulateOptions& options,
                       const CameraRig& rig,
                       const SimulatedCase& simulated,
                       const Provenance& provenance,
                       const std::filesystem::path& folder) {
  Study study;
  study.path = folder / "study.toml";
  study.rig = rig;
  study.rig_name_or_path = (folder / "rig.toml").string();
  study.cases = {simulated.study_case};
  write_text_file(folder / "rig.toml", rig_to_toml(rig));
  write_text_file(folder / "study.toml", study_to_toml(study, folder));
  write_text_file(folder / "truth.toml", truth_text(simulated));
  if (options.stress.has(Stress::Calibration))
    write_text_file(folder / "rig-true.toml", rig_to_toml(simulated.true_rig));
  nlohmann::json record = to_json(provenance);
  record["stress"] = nlohmann::json::array();
  for (const StressDescription& stress : descriptions(options.stress))
    record["stress"].push_back({{"name", stress.name}, {"text", stress.text}});
  if (simulated.moved_bone) record["moved_bone"] = simulated.moved_bone->text;
  write_text_file(folder / "provenance.json", record.dump(2) + "\n");
  write_reproduce_script(folder, provenance);
}

/// A patient as X-rays and as the CT show them. The two differ where the CT clips metal. X-rays of
/// drawn anatomies and moved bones show the bodies, not voxels.
struct Patient {
  CtVolume anatomy;
  CtVolume ct;
  std::optional<Phantom> bodies;
};

Patient patient(const SimulateOptions& options, const Communicator& world) {
  if (!options.phantom.empty()) {
    PhantomOptions sampling = options.phantom_options;
    sampling.threads = options.xray.threads;
    Phantom phantom = phantom_of(options);
    const CtVolume anatomy = sample_phantom(phantom, sampling);
    const CtVolume ct = phantom.has_metal() ? with_scanner_range(anatomy) : anatomy;
    if (!options.images_bodies()) return {anatomy, ct, std::nullopt};
    return {anatomy, ct, std::move(phantom)};
  }
  std::vector<std::string> warnings;
  const CtVolume ct = read_ct(options.ct, options.ct_reading, &warnings);
  for (const std::string& warning : warnings) warn(world, warning);
  return {ct, ct, std::nullopt};
}

CameraRig cameras(const SimulateOptions& options, const Communicator& world) {
  std::vector<std::string> warnings;
  CameraRig rig = read_rig(options.rig, &warnings);
  for (CameraGeometry& camera : rig.cameras)
    if (!camera.distortion.is_none()) {
      warnings.push_back(
          "camera '" + camera.name +
          "': simulated X-rays are not distorted; the study's rig has no distortion");
      camera.distortion = {};
    }
  for (const std::string& warning : warnings) warn(world, warning);
  return rig;
}

/// Writes the CT into the study, or refers to where it is.
std::filesystem::path ct_of_study(const SimulateOptions& options,
                                  const CtVolume& ct,
                                  const SimulatedCase& simulated,
                                  const std::filesystem::path& folder) {
  const std::optional<CtVolume> degraded = degraded_study_ct(options, ct, simulated);
  if (options.phantom.empty() && !options.copies_ct && !degraded)
    return std::filesystem::absolute(options.ct);
  std::filesystem::path path = folder / "ct.nii.gz";
  write_ct(degraded ? *degraded : ct, path);
  return path;
}

/// Plans the case and takes its X-rays into `folder`.
SimulatedCase imaged_case(const SimulateOptions& options,
                          const Patient& patient,
                          const CameraRig& rig,
                          const std::filesystem::path& folder) {
  SimulatedCase simulated =
      plan_case(options, patient.ct, rig, AttenuationVolume(patient.ct, options.attenuation));
  ProgressPrinter printer("Taking X-rays", true);
  const auto take = [&](const XraySimulator& simulator) {
    take_xrays(options, simulator, folder, simulated, printer.callback());
  };
  if (patient.bodies) {
    take(body_simulator(options, *patient.bodies, simulated));
  } else {
    const AttenuationVolume volume(imaged_anatomy(options, patient.anatomy, simulated),
                                   options.attenuation);
    take(voxel_simulator(options, volume, simulated));
  }
  return simulated;
}

/// Writes a cone-beam scan into `folder`.
void take_scan(const SimulateOptions& options,
               const Patient& imaged,
               const CameraRig& rig,
               const Provenance& provenance,
               const std::filesystem::path& folder) {
  const CircularScan scan = orbit_of(rig.cameras.front(), rig.isocenter_point, options.cone_beam);
  std::optional<Phantom> bodies;
  if (!options.phantom.empty()) bodies = phantom_of(options);
  ProgressPrinter printer("Taking X-rays", true);
  write_simulated_scan(options, imaged.ct, bodies, scan, provenance, folder, printer.callback());
}

std::string summary(const SimulatedCase& simulated, const std::filesystem::path& folder) {
  const auto offset = simulated.true_offset.deg_and_mm();
  std::string text = "True pose, relative to nominal:";
  for (std::size_t i = 0; i < 6; ++i)
    text += ' ' + fixed_text(offset[i], 2) + (i < 3 ? " deg" : " mm");
  if (simulated.moved_bone) text += "\nIt is that of the moved bone: " + simulated.moved_bone->text;
  if (simulated.fiducial_gold) {
    const RigidTransform& gold = *simulated.study_case.gold_room_from_ct;
    const RigidTransform& fitted = simulated.fiducial_gold->room_from_ct;
    const Eigen::Vector3d& center = simulated.study_case.center_ct_mm;
    text += "\nFiducial gold pose: " + fixed_text((fitted * center - gold * center).norm(), 3) +
            " mm and " + fixed_text(rotation_angle_between_rad(gold, fitted) * kDegPerRad, 3) +
            " deg from it, FRE " + fixed_text(simulated.fiducial_gold->fit.fre_mm, 3) + " mm";
  }
  if (!simulated.occluders.cylinders.empty() || !simulated.occluders.balls.empty())
    text += "\nIn the X-rays only: " + std::to_string(simulated.occluders.cylinders.size()) +
            " rods, " + std::to_string(simulated.occluders.balls.size()) + " balls";
  return text + "\nStudy: " + (folder / "study.toml").string();
}

}  // namespace

void run_simulate(const SimulateOptions& options,
                  const std::string& command_line,
                  const Communicator& world) {
  if (!world.is_root())
    return;  // the work is small, and a launcher with several ranks does no harm
  throw_if_any(problems(options));
  const CameraRig rig = cameras(options, world);
  if (!options.ct.empty()) note_input(options.ct);
  PartialFolder folder(
      options.output,
      options.replaces_output ? PartialFolder::Existing::Replace : PartialFolder::Existing::Refuse);

  inform(world, options.phantom.empty() ? "Reading " + options.ct : "Making the phantom");
  const Patient imaged = patient(options, world);
  const Provenance provenance = {"af-simulate",
                                 command_line,
                                 to_toml(options),
                                 options.seed,
                                 world.size(),
                                 {{"ct_content", identity_of(imaged.ct)}}};
  if (options.cone_beam.views > 0) {
    take_scan(options, imaged, rig, provenance, folder.path());
    folder.commit();
    inform(world, "Scan: " + (folder.final_path() / "scan.toml").string());
    return;
  }
  SimulatedCase simulated = imaged_case(options, imaged, rig, folder.path());
  inform(world, "Writing the study");
  simulated.study_case.ct = ct_of_study(options, imaged.ct, simulated, folder.path());
  // The written copy is in HU.
  if (!options.ct.empty() && simulated.study_case.ct == std::filesystem::absolute(options.ct))
    simulated.study_case.ct_reading = options.ct_reading;
  write_study_files(options, rig, simulated, provenance, folder.path());
  folder.commit();
  inform(world, summary(simulated, folder.final_path()));
}

}  // namespace af::tools
