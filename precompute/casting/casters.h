// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ct/ray_caster.h"
#include "field/attenuation_quantizer.h"
#include "geometry/light_slab.h"
#include "precompute/casting/field_caster.h"
#include "precompute/casting/slab_aligned_volume.h"
#include "precompute/casting/unit_planner.h"

namespace af {

/// Inputs of a caster, which they must outlive.
struct CasterInputs {
  const AttenuationVolume& volume;
  const SlabAlignedVolume* resampled = nullptr;  ///< only for casters that need it
  const LightSlab& light_slab;
  AttenuationQuantizer quantizer;
  RayCasterOptions ray_caster;  ///< for the trilinear caster
};

struct KnownCaster {
  const char* name = nullptr;  ///< as in options and files
  const char* help = nullptr;
  bool needs_resampled = false;  ///< the CT resampled to the light slab's frame
  PlanOptions plan;              ///< units that suit the caster
  PlanOptions sample;            ///< units small enough that casting a few measures its speed
  std::unique_ptr<const FieldCaster> (*make)(const CasterInputs& inputs) = nullptr;
};

/// The caster of that name. Throws InputError for an unknown name.
const KnownCaster& caster_named(const std::string& name);

/// Names that caster_named() knows, and one line that explains them.
std::vector<std::string> caster_names();
std::string caster_help();

}  // namespace af
