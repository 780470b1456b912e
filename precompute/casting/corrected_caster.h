// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "field/attenuation_quantizer.h"
#include "geometry/light_slab.h"
#include "precompute/casting/field_caster.h"
#include "precompute/casting/measured_residual.h"

namespace af {

/// Adds what measured X-rays show beyond the CT to another caster's line integrals. Each depth slab
/// gets the part that lies in it. Nodes that are 0 stay 0, and sums are at least 0.
/// \test CorrectedCaster.*
class CorrectedFieldCaster final : public FieldCaster {
 public:
  /// `light_slab` must outlive the caster, and so must the images of `residual`.
  CorrectedFieldCaster(std::unique_ptr<const FieldCaster> of_ct,
                       MeasuredResidual residual,
                       const LightSlab& light_slab,
                       const AttenuationQuantizer& quantizer);

  void cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const override;

 private:
  std::unique_ptr<const FieldCaster> of_ct_;
  MeasuredResidual residual_;
  const LightSlab& light_slab_;
  AttenuationQuantizer quantizer_;
  RigidTransform ct_from_slab_;
};

}  // namespace af
