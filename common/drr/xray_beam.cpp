// SPDX-License-Identifier: Apache-2.0
#include "drr/xray_beam.h"

#include <utility>

#include "base/error.h"
#include "drr/polychromatic_drr.h"
#include "drr/scattered_drr.h"

namespace af {

void XrayBeamOptions::describe(Fields& field) {
  field.part(spectrum);
  field.at("tube_kvp").help =
      "DRRs for the spectrum of a tube of this voltage, kV (docs/spectra.md); fields then need "
      "FIELD.bone.af.h5; 0: one energy";
  field("scatter_to_primary",
        scatter_to_primary,
        "Even scatter in DRRs, as a multiple of the mean primary signal (docs/spectra.md)")
      .within(0.0, 100.0);
}

XrayBeam::XrayBeam(const XrayBeamOptions& options, const AttenuationModel& model)
    : options_(options) {
  if (options.needs_bone())
    attenuation_ =
        std::make_shared<const PolychromaticAttenuation>(options.spectrum, TissueModel(model));
}

std::shared_ptr<const DrrRenderer> XrayBeam::renderer(
    std::shared_ptr<const DrrRenderer> all, std::shared_ptr<const DrrRenderer> bone) const {
  check(!options_.needs_bone() || bone, "a spectrum needs a renderer of bone");
  std::shared_ptr<const DrrRenderer> made = std::move(all);
  if (attenuation_)
    made = std::make_shared<const PolychromaticDrr>(std::move(made), std::move(bone), attenuation_);
  if (options_.scatter_to_primary > 0.0)
    made = std::make_shared<const ScatteredDrr>(std::move(made), options_.scatter_to_primary);
  return made;
}

}  // namespace af
