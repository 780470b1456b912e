// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ct/ray_caster.h"
#include "field/attenuation_quantizer.h"
#include "geometry/light_slab.h"
#include "precompute/casting/field_caster.h"

namespace af {

/// The reference: trilinear samples along every ray (RayCaster), cut to the unit's slab.
/// \test TrilinearFieldCaster.SamplesEqualSingleRays
class TrilinearFieldCaster final : public FieldCaster {
 public:
  /// `volume` and `light_slab` must outlive the caster.
  TrilinearFieldCaster(const AttenuationVolume& volume,
                       const LightSlab& light_slab,
                       const AttenuationQuantizer& quantizer,
                       const RayCasterOptions& options);

  void cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const override;

 private:
  const LightSlab& light_slab_;
  AttenuationQuantizer quantizer_;
  RayCaster caster_;
  RigidTransform ct_from_slab_;
};

}  // namespace af
