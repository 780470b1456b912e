// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "field/attenuation_quantizer.h"
#include "geometry/light_slab.h"
#include "precompute/units/work_unit.h"
#include "volume/ray_caster.h"

namespace af {

/// The one interface of every caster of fields: the quantised line integrals of one unit.
class FieldCaster {
 public:
  virtual ~FieldCaster() = default;

  /// Quantised total attenuation of the unit's slab along the ray through each viewpoint and
  /// (s,t) node, past the (s,t) plane through the whole CT. `samples` is [u][v][s][t], t fastest,
  /// unit.sample_count() values. A sample depends on its node alone, never on the unit it is cast
  /// in. Re-entrant.
  virtual void cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const = 0;
};

/// The reference: trilinear samples along every ray (RayCaster), cut to the unit's slab.
/// \test RayCastFieldCaster.SamplesEqualSingleRays
class RayCastFieldCaster final : public FieldCaster {
 public:
  /// `volume` and `light_slab` must outlive the caster.
  RayCastFieldCaster(const AttenuationVolume& volume,
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

/// The cost of casting each unit, in units of one ray through the whole CT, for handing out the
/// costly units first. Rays that miss the box of all attenuation (`attenuating_corners_ct`, ct
/// frame) cost little, and a thin slab costs less, because fewer slices are summed.
std::vector<double> unit_costs(const std::vector<WorkUnit>& units,
                               const LightSlab& light_slab,
                               const std::array<Eigen::Vector3d, 8>& attenuating_corners_ct);

}  // namespace af
