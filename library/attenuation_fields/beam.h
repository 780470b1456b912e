// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace attenuation_fields {

/// The X-rays that DRRs simulate. By default they have one energy, the effective one of the CT's HU
/// scale, and no scatter.
struct Beam {
  double tube_kvp = 0.0;            ///< tube voltage, kV; 0: one energy
  double aluminium_mm = 3.0;        ///< total filtration, with a tube voltage
  double scatter_to_primary = 0.0;  ///< mean scatter divided by mean primary
};

}  // namespace attenuation_fields
