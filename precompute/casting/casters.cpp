// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/casters.h"

#include <array>

#include "base/named_rows.h"
#include "precompute/casting/shear_warp_caster.h"
#include "precompute/casting/trilinear_caster.h"

namespace af {
namespace {

using CasterPointer = std::unique_ptr<const FieldCaster>;

CasterPointer make_trilinear(const CasterInputs& inputs) {
  return std::make_unique<TrilinearFieldCaster>(
      inputs.volume, inputs.light_slab, inputs.quantizer, inputs.ray_caster);
}

CasterPointer make_shear_warp(const CasterInputs& inputs) {
  return std::make_unique<ShearWarpFieldCaster>(
      *inputs.resampled, inputs.light_slab, inputs.quantizer);
}

constexpr PlanOptions kSmallUnits{4096};

/// Every caster. A new one is added here.
constexpr std::array kCasters = {
    KnownCaster{"trilinear",
                "the reference, samples along every ray",
                false,
                PlanOptions{},
                kSmallUnits,
                make_trilinear},
    KnownCaster{"shear-warp",
                "slice by slice, some 50 times faster",
                true,
                kShearWarpPlan,
                kShearWarpPlan,
                make_shear_warp},
};

}  // namespace

const KnownCaster& caster_named(const std::string& name) {
  return required_row(kCasters, "caster", name);
}

std::vector<std::string> caster_names() {
  return names_of(kCasters);
}

std::string caster_help() {
  return help_of(kCasters);
}

}  // namespace af
