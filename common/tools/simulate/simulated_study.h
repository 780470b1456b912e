// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "gold_standard/fiducial_registration.h"
#include "run/provenance.h"
#include "simulation/xray_simulator.h"
#include "study/study_file.h"
#include "tools/simulate/simulate_options.h"

namespace af::tools {

/// A case before its X-rays are taken: where the patient lies and what is to be found.
struct SimulatedCase {
  StudyCase study_case;        ///< without file names; gold_room_from_ct is the true pose
  PoseParameters true_offset;  ///< of the true pose from the nominal one
  CameraRig true_rig;          ///< that takes the X-rays; the study's own may miss it
  std::vector<SteelCylinder> fiducials;
  SteelBodies occluders;  ///< in the X-rays only, besides the fiducials
  std::vector<std::vector<Eigen::Vector2d>> exact_fiducials_px;  ///< per view, without noise
  std::optional<FiducialGold> fiducial_gold;
};

/// Chooses target, regions, true pose, true cameras, fiducials and occluders. Throws InputError
/// when the target or a fiducial misses a detector, or a source lies inside the CT.
SimulatedCase plan_case(const SimulateOptions& options,
                        const CtVolume& ct,
                        const CameraRig& rig,
                        const AttenuationVolume& volume);

/// The simulator of this case's X-rays from voxels (`volume` must outlive it) and from a phantom's
/// bodies themselves; each with the wanted non-rigid motion.
XraySimulator voxel_simulator(const SimulateOptions& options,
                              const AttenuationVolume& volume,
                              const SimulatedCase& simulated);
XraySimulator body_simulator(const SimulateOptions& options,
                             const Phantom& phantom,
                             const SimulatedCase& simulated);

/// What voxels show: the anatomy itself, or with the wanted non-rigid motion.
CtVolume imaged_anatomy(const SimulateOptions& options,
                        const CtVolume& anatomy,
                        const SimulatedCase& simulated);

/// What the study's CT is to be when it is not the input itself: a wanted degraded one.
std::optional<CtVolume> degraded_study_ct(const SimulateOptions& options,
                                          const CtVolume& ct,
                                          const SimulatedCase& simulated);

/// Takes the X-ray of every view and writes it with its preview into `folder`; fills in the file
/// names.
void take_xrays(const SimulateOptions& options,
                const XraySimulator& simulator,
                const std::filesystem::path& folder,
                SimulatedCase& simulated,
                const ProgressCallback& progress);

/// study.toml, rig.toml, truth.toml, rig-true.toml where it differs, provenance.json and
/// reproduce.sh.
void write_study_files(const SimulateOptions& options,
                       const CameraRig& rig,
                       const SimulatedCase& simulated,
                       const Provenance& provenance,
                       const std::filesystem::path& folder);

}  // namespace af::tools
