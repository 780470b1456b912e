// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "simulation/tissue_model.h"
#include "volume/attenuation_volume.h"

namespace af {

/// Line integrals of relative attenuation (1 for water) along a ray: mm of water that attenuate
/// alike at the effective energy.
struct PathIntegrals {
  double water_mm = 0.0;
  double bone_mm = 0.0;
};

/// Exact radiological path through voxels that are boxes of constant attenuation (R. L. Siddon,
/// Med. Phys. 12:252, 1985; incremental form of F. Jacobs et al., J. Comput. Inf. Technol. 6:89,
/// 1998). Deliberately not the field's trilinear caster: X-rays must not come from the projector
/// that is tested with them. A ray that runs exactly within a face of a voxel belongs to the voxel
/// above it. Re-entrant. \test SiddonProjector.EqualsBruteForceBoxClipping
class SiddonProjector {
 public:
  /// Both must outlive the projector.
  SiddonProjector(const AttenuationVolume& volume, const TissueModel& tissue);

  /// Integrals over the half-line from `source_point` through `through_point` (ct, mm) and on; a
  /// source inside the volume starts there.
  [[nodiscard]] PathIntegrals integrate(const Eigen::Vector3d& source_point,
                                        const Eigen::Vector3d& through_point) const;

 private:
  const AttenuationVolume& volume_;
  const TissueModel& tissue_;
};

}  // namespace af
