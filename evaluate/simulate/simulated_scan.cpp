// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/simulated_scan.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/number_text.h"
#include "base/toml_text.h"
#include "ct/ct_reader.h"
#include "evaluate/simulate/automatic_target.h"
#include "evaluate/simulate/detector_model.h"
#include "evaluate/simulate/xray_simulator.h"
#include "files/output_file.h"
#include "files/toml_reader.h"
#include "study/rig_file.h"
#include "study/study_file.h"
#include "xray/image_file.h"

namespace af::tools {

namespace {

namespace fs = std::filesystem;

constexpr int kIndexDigits = 4;

std::string view_file(int view) {
  std::string digits = std::to_string(view);
  digits.insert(0, kIndexDigits - std::min<std::size_t>(kIndexDigits, digits.size()), '0');
  return "view-" + digits + ".mha";
}

/// The middle half of the detector, which every view of the circle sees. The scatter-to-primary
/// ratio holds there, and predictions are judged there.
RegionOfInterest middle_of(const CircularScan& scan) {
  const Eigen::Vector2i size = scan.size_px;
  return {size.x() / 4, size.y() / 4, size.x() / 2, size.y() / 2};
}

void refuse_too_large(const CtGrid& grid, const CircularScan& scan) {
  const Eigen::Vector3d half = 0.5 * grid.spacing_mm.cwiseProduct(Eigen::Vector3d(
                                         grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1));
  const Eigen::Vector3d reach = grid.direction.cwiseAbs() * half;
  const double radius_mm = std::hypot(reach.x(), reach.y());
  const double free_mm =
      std::min(scan.source_to_axis_mm, scan.source_to_detector_mm - scan.source_to_axis_mm);
  if (radius_mm >= free_mm)
    throw InputError("cone_beam",
                     number_text(radius_mm) + " mm from the axis",
                     "the CT must lie within " + number_text(free_mm) +
                         " mm, where source and detector of this rig pass");
}

XraySimulator simulator_of(const SimulateOptions& options,
                           const XraySimulationOptions& imaging,
                           const AttenuationVolume& volume,
                           const std::optional<Phantom>& bodies) {
  if (bodies) return {*bodies, std::nullopt, options.attenuation, SteelBodies{}, imaging};
  return {volume, SteelBodies{}, imaging};
}

std::string scan_text(const SimulateOptions& options, const CircularScan& scan) {
  const ConeBeamOptions& orbit = options.cone_beam;
  std::string text = "# A cone-beam scan simulated by af-simulate. Lengths in mm.\n";
  text += "name = " + toml_text(options.case_name_in_force()) + "\n";
  text += "source_to_axis_mm = " + toml_number(scan.source_to_axis_mm) + "\n";
  text +=
      "axis_to_detector_mm = " + toml_number(scan.source_to_detector_mm - scan.source_to_axis_mm) +
      "\n";
  text += "pixel_spacing_mm = " + toml_numbers(scan.pixel_spacing_mm) + "\n";
  text += "size_px = [" + std::to_string(scan.size_px.x()) + ", " +
          std::to_string(scan.size_px.y()) + "]\n";
  text += "rotation_axis = \"rows\"\n";
  text += "beam_foot_px = " + toml_numbers(scan.stated_foot_px()) + "\n";
  text += "view_count = " + std::to_string(orbit.views) + "\n";
  text += "first_angle_deg = 0.0\n";
  text += "step_deg = " + toml_number(orbit.step_deg()) + "\n";
  text += "files = \"view-{:04}.mha\"\n";
  text += "xray_domain = \"intensity\"\n";
  return text;
}

/// The X-rays of the circle.
void write_circle(const SimulateOptions& options,
                  const XraySimulator& simulator,
                  const CircularScan& scan,
                  const fs::path& folder,
                  const ProgressCallback& progress) {
  const ScanCalibration exact = ScanCalibration::nominal(scan);
  const int bits = options.xray_in_force().detector.bits;
  const auto write = bits == 0 ? write_image : write_image_u16;
  for (int view = 0; view < options.cone_beam.views; ++view) {
    const CameraGeometry camera =
        scan_camera(scan, exact, scan.angles_rad[static_cast<std::size_t>(view)]);
    const std::uint64_t key = hash64(hash_name(options.case_name_in_force()),
                                     hash_name("scan"),
                                     static_cast<std::uint64_t>(view));
    const Image2d xray =
        simulator.xray({camera, middle_of(scan)}, RigidTransform::Identity(), options.seed, key);
    write(xray, folder / view_file(view), scan.pixel_spacing_mm.x(), scan.pixel_spacing_mm.y());
    if (progress) progress(view + 1, options.cone_beam.views);
  }
}

/// Angles of odd views, as many before the first view as after it. There af-scan's even views, from
/// which it reconstructs, are farthest.
std::vector<double> angles_between(const ConeBeamOptions& orbit) {
  std::vector<double> angles_rad;
  angles_rad.reserve(static_cast<std::size_t>(orbit.elevated_views));
  const int before = orbit.elevated_views / 2;
  for (int i = -before; i < orbit.elevated_views - before; ++i)
    angles_rad.push_back(kRadPerDeg * ((2 * i + 1) * orbit.step_deg()));
  return angles_rad;
}

StudyCase elevated_case(double elevation_deg, const fs::path& folder) {
  StudyCase result;
  result.name = "elevation-" + number_text(elevation_deg);
  result.note = "line integrals without noise, " + number_text(elevation_deg) +
                " degrees above the circle of scan.toml, simulated by af-simulate";
  result.ct = folder / "ct.nii.gz";
  result.gold_room_from_ct = RigidTransform::Identity();
  result.target_box_ct = target_box_at(Eigen::Vector3d::Zero(), kTargetSideMm).box_ct;
  return result;
}

/// Line integrals without noise, 0 on average in the air beside the object. af-scan takes its air
/// level there too, because scatter brightens it.
Image2d noiseless_line_integrals(const XraySimulator& simulator,
                                 const DetectorOptions& detector,
                                 const CameraGeometry& camera,
                                 const RegionOfInterest& middle) {
  const Image2d primary = simulator.primary_image(camera, RigidTransform::Identity());
  Image2d image = detect(primary, middle, camera.pixel_spacing_mm.x(), detector, 0, 0, 1);
  double air_sum = 0.0;
  std::size_t air_count = 0;
  for (std::size_t i = 0; i < primary.pixels.size(); ++i)
    if (primary.pixels[i] == 1.0F) {
      air_sum += static_cast<double>(image.pixels[i]);
      ++air_count;
    }
  const double air =
      air_count > 0 ? air_sum / static_cast<double>(air_count) : detector.open_beam_level;
  for (float& value : image.pixels)
    value = static_cast<float>(-std::log(static_cast<double>(value) / air));
  return image;
}

/// Writes elevated.toml, its rig and its X-rays.
void write_elevated(const SimulateOptions& options,
                    const XraySimulator& noiseless,
                    const DetectorOptions& detector,
                    const CircularScan& scan,
                    const fs::path& folder) {
  Study study;
  study.path = folder / "elevated.toml";
  study.rig_name_or_path = (folder / "elevated" / "rig.toml").string();
  fs::create_directory(folder / "elevated");
  const std::vector<double> angles_rad = angles_between(options.cone_beam);
  for (const double elevation_deg : options.cone_beam.elevations_deg) {
    StudyCase of_elevation = elevated_case(elevation_deg, folder);
    for (std::size_t i = 0; i < angles_rad.size(); ++i) {
      const std::string name = "elevated-" + number_text(elevation_deg) + "-" + std::to_string(i);
      const CameraGeometry camera = elevated_camera(scan, angles_rad[i], elevation_deg, name);
      const Image2d image = noiseless_line_integrals(noiseless, detector, camera, middle_of(scan));
      StudyView view;
      view.camera = name;
      view.xray = folder / "elevated" / (name + ".mha");
      view.xray_domain = XrayDomain::Attenuation;
      view.roi = middle_of(scan);
      write_image(image, view.xray, scan.pixel_spacing_mm.x(), scan.pixel_spacing_mm.y());
      of_elevation.views.push_back(std::move(view));
      study.rig.cameras.push_back(camera);
    }
    study.cases.push_back(std::move(of_elevation));
  }
  write_text_file(study.rig_name_or_path, rig_to_toml(study.rig));
  write_text_file(study.path, study_to_toml(study, folder));
}

}  // namespace

CircularScan orbit_of(const CameraGeometry& camera,
                      const Eigen::Vector3d& isocenter_point,
                      const ConeBeamOptions& options) {
  const Eigen::Vector3d to_isocenter = isocenter_point - camera.source_point;
  const Eigen::Vector2d foot_px = camera.project(
      camera.source_point + camera.source_detector_distance_mm() * camera.beam_direction());
  constexpr double kMostBesidePx = 0.5;
  if (!((camera.project(isocenter_point) - foot_px).norm() <= kMostBesidePx))
    throw InputError("camera",
                     camera.name,
                     "must look straight at the rig's isocentre, about which a scan turns it");
  CircularScan scan;
  scan.source_to_axis_mm = to_isocenter.norm();
  scan.source_to_detector_mm = camera.source_detector_distance_mm();
  scan.pixel_spacing_mm = camera.pixel_spacing_mm;
  scan.size_px = camera.size_px;
  scan.axis_along = AxisAlong::Rows;
  scan.beam_foot_px = foot_px;
  for (int view = 0; view < options.views; ++view)
    scan.angles_rad.push_back(kRadPerDeg * (view * options.step_deg()));
  return scan;
}

CameraGeometry elevated_camera(const CircularScan& scan,
                               double angle_rad,
                               double elevation_deg,
                               const std::string& name) {
  CameraGeometry camera = scan_camera(scan, ScanCalibration::nominal(scan), angle_rad, name);
  // The tangent of the circle at angle 0 is +x, so a positive turn about it lowers the source.
  const Eigen::Vector3d tangent(std::cos(angle_rad), std::sin(angle_rad), 0.0);
  const Eigen::Matrix3d lift =
      Eigen::AngleAxisd(-elevation_deg * kRadPerDeg, tangent).toRotationMatrix();
  for (Eigen::Vector3d* const vector : {&camera.source_point,
                                        &camera.detector_origin_point,
                                        &camera.column_direction,
                                        &camera.row_direction})
    *vector = lift * *vector;
  return camera;
}

void write_simulated_scan(const SimulateOptions& options,
                          const CtVolume& ct,
                          const std::optional<Phantom>& bodies,
                          const CircularScan& scan,
                          const Provenance& provenance,
                          const std::filesystem::path& folder,
                          const ProgressCallback& progress) {
  refuse_too_large(ct.grid, scan);
  CtVolume centred = ct;
  centred.grid.origin_mm -= ct.grid.center_mm();
  const AttenuationVolume volume(centred, options.attenuation);
  const XraySimulationOptions imaging = options.xray_in_force();
  write_circle(options, simulator_of(options, imaging, volume, bodies), scan, folder, progress);
  if (!options.cone_beam.elevations_deg.empty()) {
    XraySimulationOptions noiseless = imaging;
    noiseless.detector.photons_per_pixel = 0.0;
    noiseless.detector.bits = 0;
    write_elevated(options,
                   simulator_of(options, noiseless, volume, bodies),
                   noiseless.detector,
                   scan,
                   folder);
  }
  write_ct(centred, folder / "ct.nii.gz");
  write_text_file(folder / "scan.toml", scan_text(options, scan));
  write_text_file(folder / "provenance.json", to_json(provenance).dump(2) + "\n");
  write_reproduce_script(folder, provenance);
}

}  // namespace af::tools
