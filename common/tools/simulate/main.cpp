// SPDX-License-Identifier: Apache-2.0
// af-simulate: a whole registration study, with a known answer, from a CT or a phantom.
#include <optional>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "cli/app_main.h"
#include "cli/bind_options.h"
#include "files/input_guard.h"
#include "files/partial_folder.h"
#include "image_files/ct_reader.h"
#include "run/progress_printer.h"
#include "run/terminal.h"
#include "study/rig_file.h"
#include "text/csv_table.h"
#include "text/options_toml.h"
#include "tools/simulate/simulate_options.h"
#include "tools/simulate/simulated_scan.h"
#include "tools/simulate/simulated_study.h"

namespace {

using namespace af;
using tools::SimulatedCase;
using tools::SimulateOptions;

/// A patient as X-rays and as the CT show them. The two differ where the CT clips metal; and X-rays
/// of drawn anatomies are of the bodies, not of voxels.
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
    if (!sampling.anatomy_seed) return {anatomy, ct, std::nullopt};
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
  const CameraGeometry& camera =
      options.cone_beam.camera.empty() ? rig.cameras.front() : rig.camera(options.cone_beam.camera);
  const CircularScan scan = orbit_of(camera, rig.isocenter_point, options.cone_beam);
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

void run(const SimulateOptions& options,
         const std::string& command_line,
         const Communicator& world) {
  if (!world.is_root()) return;  // the work is small; a launcher with several ranks does no harm
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
                                 {{"ct_content", ct_content_sha256(imaged.ct)}}};
  if (options.cone_beam.views > 0) {
    take_scan(options, imaged, rig, provenance, folder.path());
    folder.commit();
    inform(world, "Scan: " + (folder.final_path() / "scan.toml").string());
    return;
  }
  SimulatedCase simulated = imaged_case(options, imaged, rig, folder.path());
  inform(world, "Writing the study");
  simulated.study_case.ct = ct_of_study(options, imaged.ct, simulated, folder.path());
  // A copy is in HU.
  if (!options.ct.empty() && simulated.study_case.ct == std::filesystem::absolute(options.ct))
    simulated.study_case.ct_reading = options.ct_reading;
  write_study_files(options, rig, simulated, provenance, folder.path());
  folder.commit();
  inform(world, summary(simulated, folder.final_path()));
}

}  // namespace

// Outside app_main only the declaration of options can throw, which is a defect of this program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  SimulateOptions options;
  CLI::App app{
      "Makes a registration study with a known answer: X-rays of a CT or phantom by an exact "
      "polyenergetic projector with scatter, noise, blur and grey levels, steel fiducials and "
      "their detections, regions of interest, and the true pose. With --cone-beam a circular scan "
      "for af-scan instead."};
  cli::bind_options(app, options);
  const std::string command_line = cli::command_line(argc, argv);
  return cli::app_main(
      app, argc, argv, [&](const Communicator& world) { run(options, command_line, world); });
}
