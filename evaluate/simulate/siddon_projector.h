// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ct/attenuation_volume.h"
#include "drr/tissue_model.h"
#include "evaluate/simulate/ray_integrator.h"

namespace af {

/// Exact radiological path through voxels that are boxes of constant attenuation (R. L. Siddon,
/// Med. Phys. 12:252, 1985; incremental form of F. Jacobs et al., J. Comput. Inf. Technol. 6:89,
/// 1998). It is deliberately not the field's trilinear caster: X-rays must not come from the
/// projector that is tested with them. A ray that runs exactly within a face of a voxel belongs to
/// the voxel above it. Re-entrant. \test SiddonProjector.EqualsBruteForceBoxClipping
class SiddonProjector : public RayIntegrator {
 public:
  /// Both must outlive the projector.
  SiddonProjector(const AttenuationVolume& volume, const TissueModel& tissue);

  [[nodiscard]] PathIntegrals integrate(const Eigen::Vector3d& source_point,
                                        const Eigen::Vector3d& through_point) const override;

 private:
  const AttenuationVolume& volume_;
  const TissueModel& tissue_;
};

}  // namespace af
