// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/scan_run.h"

#include <iostream>

#include "base/error.h"
#include "ct/ct_reader.h"
#include "evaluate/scan/scan_file.h"
#include "evaluate/scan/scan_reading.h"
#include "evaluate/scan/scan_study.h"
#include "files/options_toml.h"
#include "files/partial_folder.h"
#include "ranks/terminal.h"

namespace af::tools {

namespace {

/// Calibrates on the even views, judges on the odd ones, reconstructs the even ones.
CalibratedScan calibrated_scan(const ScanOptions& options,
                               const std::string& name,
                               int enlarged,
                               ScanImages images,
                               ThreadPool& pool,
                               const ReportLine& report) {
  const int count = static_cast<int>(images.scan.angles_rad.size());
  const std::vector<int> even = CircularScan::every(0, 2, count);
  const std::vector<int> odd = CircularScan::every(1, 2, count);
  const SelfCalibrationOptions& how = options.calibration;
  CalibratedScan scan;
  scan.name = name;
  scan.enlarged = enlarged;
  scan.calibration = options.is_as_stated ? ScanCalibration::nominal(images.scan)
                                          : self_calibrate(images, even, how, pool, report);
  report("Judging by the odd views");
  scan.calibrated = held_out_residual(images, scan.calibration, even, odd, how, pool);
  scan.as_stated =
      options.is_as_stated
          ? scan.calibrated
          : held_out_residual(
                images, stated_calibration(images, even, how, pool), even, odd, how, pool);
  report("Reconstructing the even views");
  FdkOptions fdk = options.fdk;
  constexpr double kVoxelPx = 1.5;
  if (fdk.voxel_mm == 0.0)
    fdk.voxel_mm = kVoxelPx * images.scan.pixel_spacing_mm.minCoeff() *
                   images.scan.source_to_axis_mm / scan.calibration.source_to_detector_mm;
  const MuVolume volume = reconstruct_views(images, scan.calibration, even, fdk, pool);
  scan.water_mu_per_mm = registration_water_mu_per_mm(volume);
  scan.object_radius_mm = object_radius_mm(volume);
  scan.ct = ct_of(volume, scan.water_mu_per_mm);
  scan.images = std::move(images);
  return scan;
}

}  // namespace

void run_scan(const ScanOptions& options,
              const std::string& command_line,
              const Communicator& world) {
  if (!world.is_root()) return;  // one process does the work, with threads
  throw_if_any(problems(options));
  ScanFile file = read_scan_file(options.scan);
  const int enlarged = options.enlarges_small ? room_for_registration(file.scan) : 1;
  file.scan = file.scan.enlarged(enlarged);
  PartialFolder folder(
      options.output,
      options.replaces_output ? PartialFolder::Existing::Replace : PartialFolder::Existing::Refuse);
  ThreadPool pool(thread_count(options.threads));
  const std::filesystem::path images_folder =
      options.folder.empty() ? std::filesystem::absolute(options.scan).parent_path()
                             : options.folder;
  std::string warnings;  // repeated at the end: much may have been printed since
  const auto report = [&](const std::string& line) {
    inform(world, line);
    if (line.starts_with("Warning")) warnings += "\n" + line;
  };
  report("Reading " + std::to_string(file.scan.angles_rad.size()) + " views of " + file.name);
  ScanImages images = read_scan_images(file, images_folder, options.most_px, pool, report);
  const CalibratedScan scan =
      calibrated_scan(options, file.name, enlarged, std::move(images), pool, report);
  const Provenance provenance = {"af-scan",
                                 command_line,
                                 to_toml(options),
                                 options.seed,
                                 world.size(),
                                 {{"ct_content", identity_of(scan.ct)}}};
  const std::string found = write_scan_study(options, scan, provenance, folder.path());
  folder.commit();
  std::cout << found << warnings << "\nStudy: " << (folder.final_path() / "study.toml").string()
            << '\n';
}

}  // namespace af::tools
