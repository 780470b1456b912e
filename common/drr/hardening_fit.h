// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "drr/hardening_kernel.h"

namespace af {

/// Weight of an energy in the open beam, and how much more water and bone attenuate there than at
/// the effective energy.
struct HardeningBin {
  double weight;
  double water;
  double bone;
};

/// The polynomial that comes nearest to U of a spectrum. Least squares are taken over nodes that
/// are dense where the beam is soft; they are relative where U exceeds 8. `attenuation`: U of water
/// and bone. `slope_of_air`: dU / d water at 0.
///
/// The coefficients of both materials at all energies lie nearly on a line, because both are mostly
/// photoelectric absorption plus a part that hardly depends on the energy. Along that line the beam
/// hardens, fast at first. Across it U is nearly straight.
HardeningPolynomial fitted_hardening(
    const std::vector<HardeningBin>& spectrum,
    const std::function<double(double water, double bone)>& attenuation,
    double slope_of_air);

}  // namespace af
