// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "drr/drr_renderer.h"
#include "drr/polychromatic_attenuation.h"

namespace af {

/// The X-rays that DRRs simulate, by default with one energy and no scatter.
struct XrayBeamOptions {
  SpectrumOptions spectrum = SpectrumOptions::one_energy();
  double scatter_to_primary = 0.0;

  /// Whether the bone's part needs a renderer beside the ordinary one.
  [[nodiscard]] bool needs_bone() const { return !spectrum.is_one_energy(); }
  /// Whether DRRs are those of the ordinary renderer, unchanged.
  [[nodiscard]] bool is_ordinary() const { return !needs_bone() && scatter_to_primary == 0.0; }
  void describe(Fields& field);
};

/// Turns renderers of ordinary DRRs into those of a beam.
class XrayBeam {
 public:
  /// `model`: that of the ordinary DRRs. Throws InputError when its mu_water fits no energy of a
  /// spectrum.
  XrayBeam(const XrayBeamOptions& options, const AttenuationModel& model);

  /// Returns the ordinary renderer itself when the beam has one energy and no scatter. `bone` is
  /// required where needs_bone().
  [[nodiscard]] std::shared_ptr<const DrrRenderer> renderer(
      std::shared_ptr<const DrrRenderer> all, std::shared_ptr<const DrrRenderer> bone) const;

 private:
  XrayBeamOptions options_;
  std::shared_ptr<const PolychromaticAttenuation> attenuation_;  ///< none for one energy
};

}  // namespace af
