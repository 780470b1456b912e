// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "field/attenuation_quantizer.h"
#include "geometry/light_slab.h"
#include "precompute/casting/field_caster.h"
#include "precompute/casting/slab_aligned_volume.h"
#include "precompute/casting/unit_planner.h"

namespace af {

/// Unit size for the shear-warp caster: a few hundredths of a second and little memory.
inline constexpr PlanOptions kShearWarpPlan{std::int64_t{1} << 22};

/// Casts a field from a slab-aligned volume. From one viewpoint, each slice y = const maps to the
/// (s,t) nodes by a scale and a shift along x and along z. A slice is therefore interpolated along
/// z once for all viewpoints of equal v (first pass), and then only along x, contiguously in t
/// (second pass). The integral along a ray is the sum over slices (trapezoidal rule) times the
/// slices' distance along the ray: Joseph's method on the resampled grid.
///
/// All sums are integers, so samples are bit-identical for every vector width and in every unit.
/// Any number of slabs works: each sums its own slices. Units that are long in u share the first
/// pass among more viewpoints. \test ShearWarpFieldCaster.*
class ShearWarpFieldCaster final : public FieldCaster {
 public:
  /// `volume` and `light_slab` must outlive the caster. `volume` is resampled to light_slab's
  /// frame.
  ShearWarpFieldCaster(const SlabAlignedVolume& volume,
                       const LightSlab& light_slab,
                       const AttenuationQuantizer& quantizer);

  void cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const override;

 private:
  const SlabAlignedVolume& volume_;
  const LightSlab& light_slab_;
  AttenuationQuantizer quantizer_;
};

}  // namespace af
