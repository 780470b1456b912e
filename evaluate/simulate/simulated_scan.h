// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "base/progress.h"
#include "ct/ct_volume.h"
#include "evaluate/scan/scan_geometry.h"
#include "evaluate/simulate/phantom.h"
#include "evaluate/simulate/simulate_options.h"
#include "geometry/camera_geometry.h"
#include "ranks/provenance.h"

namespace af::tools {

/// The circle of a camera about +z through its rig's isocentre: its distances and detector, with
/// the axis along decreasing rows. Throws InputError when the camera does not look straight at the
/// isocentre, because an orbit has no other centre.
CircularScan orbit_of(const CameraGeometry& camera,
                      const Eigen::Vector3d& isocenter_point,
                      const ConeBeamOptions& options);

/// The scan's camera at an angle, lifted towards +z by `elevation_deg` about the origin.
CameraGeometry elevated_camera(const CircularScan& scan,
                               double angle_rad,
                               double elevation_deg,
                               const std::string& name);

/// Takes a cone-beam scan of a CT, or of a phantom's `bodies` themselves, whose centre lies on the
/// axis. Writes into `folder`: scan.toml and an X-ray per angle, as af-scan reads them, and
/// ct.nii.gz in the scan's frame. If elevations are asked for, it also writes elevated.toml, a
/// study of line integrals without noise, seen from above the circle. Throws InputError when the
/// source or the detector would pass through the object.
void write_simulated_scan(const SimulateOptions& options,
                          const CtVolume& ct,
                          const std::optional<Phantom>& bodies,
                          const CircularScan& scan,
                          const Provenance& provenance,
                          const std::filesystem::path& folder,
                          const ProgressCallback& progress);

}  // namespace af::tools
