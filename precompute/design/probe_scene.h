// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "field/attenuation_quantizer.h"
#include "geometry/slab_sizing.h"
#include "precompute/casting/casters.h"
#include "precompute/casting/depth_slabs.h"
#include "precompute/design/field_design.h"

namespace af {

/// What a probe looks at: one CT in front of one moving camera. It must outlive the probe.
struct ProbeScene {
  const AttenuationVolume& volume;
  const SlabAlignedVolume& resampled;    ///< in the field's frame
  std::vector<std::int64_t> slice_sums;  ///< of the resampled CT
  CameraGeometry camera;
  PoseFrame frame;
  MotionRange range;
  AttenuationQuantizer quantizer;
  std::optional<StPlane> st_plane;  ///< none: the default for the number of slabs
  std::string caster = "shear-warp";
  RayCasterOptions ray_caster;  ///< for the trilinear caster
  std::vector<HalfSpace>
      sources;  ///< those of the range's poses that must be held: LightSlabSpec::sources

  /// The planes of a design, as af-precompute makes them. Throws as choose_depth_slabs() and
  /// make_light_slab() do.
  [[nodiscard]] LightSlab planes(const FieldDesign& design) const;
  /// A caster for such planes, which must outlive it.
  [[nodiscard]] std::unique_ptr<const FieldCaster> make_caster(const LightSlab& planes) const;
  /// How many slices attenuate: the most slabs that can be made.
  [[nodiscard]] int most_slabs() const;
};

}  // namespace af
