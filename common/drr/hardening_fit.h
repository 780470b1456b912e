// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "drr/hardening_kernel.h"

namespace af {

/// Weight of an energy in the open beam, and how much more than at the effective energy water and
/// bone attenuate there.
struct HardeningBin {
  double weight;
  double water;
  double bone;
};

/// The polynomial that comes nearest to U of a spectrum, by least squares (relative ones where U
/// exceeds 8) over nodes that are dense where the beam is soft. `attenuation`: U of water and bone;
/// `slope_of_air`: dU / d water at 0.
///
/// The coefficients of both materials at all energies lie nearly on a line, because both are mostly
/// photoelectric absorption plus a part that hardly depends on the energy. Along that line the beam
/// hardens, fast at first; across it U is nearly straight.
HardeningPolynomial fitted_hardening(
    const std::vector<HardeningBin>& spectrum,
    const std::function<double(double water, double bone)>& attenuation,
    double slope_of_air);

}  // namespace af
