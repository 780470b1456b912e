// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "drr/hardening_fit.h"
#include "drr/tissue_model.h"
#include "drr/xray_spectrum.h"

namespace af {

/// What a detector behind a ray sees of a whole spectrum, expressed as total attenuation:
///
///     U = -ln sum_E S(E) exp(-(water k_water(E) + bone k_bone(E))),    k(E) = mu(E) / mu(E_0),
///
/// where water and bone are the ray's line integrals of each at the effective energy E_0 of the HU
/// scale, and S is the detected spectrum of the open beam. Water and bone are TissueModel's. At the
/// single energy E_0 it is U = water + bone, the linear HU model. (Basis materials after R. E.
/// Alvarez and A. Macovski, Phys. Med. Biol. 21:733, 1976.)
///
/// Vector kernels compute pixels from a polynomial in single precision (HardeningPolynomial). They
/// are within tolerance() of the sum up to 12 of water and 8 of bone; beyond that U continues
/// straight. \test PolychromaticAttenuation.IsWithinItsToleranceOfTheSum
class PolychromaticAttenuation {
 public:
  /// Largest difference from exactly(), in U (in U / 8 where U exceeds 8): first for tubes of at
  /// least 60 kV behind at least 1 mm of aluminium, then for all others.
  static constexpr double kTolerance = 2e-4;
  static constexpr double kToleranceOfSoftBeams = 2e-3;

  struct Value {
    double attenuation = 0.0;  ///< U
    double by_all = 0.0;       ///< dU / d all, where bone stays
    double by_bone = 0.0;      ///< dU / d bone, where all stays: water becomes bone
  };

  PolychromaticAttenuation(const SpectrumOptions& options, const TissueModel& tissue);

  /// Turns `all` into U. `all`: line integrals at the effective energy, bone included (an ordinary
  /// DRR). `bone`: bone's part of them. Impossible values, which noise causes, are limited: bone
  /// below 0 counts as 0, and bone above `all` as `all`. Below `all` = 0, U continues with its
  /// slope at 0. Bits do not depend on the vector width.
  void apply(std::span<float> all, std::span<const float> bone) const;
  /// The same for planes of derivatives of both, one after the other, by the chain rule.
  void apply(std::span<float> all,
             std::span<const float> bone,
             std::span<float> all_slopes,
             std::span<const float> bone_slopes) const;
  /// apply() for one ray.
  [[nodiscard]] Value at(double all, double bone) const;
  /// The same by the sum over the spectrum, for rays of any length.
  [[nodiscard]] Value exactly(double all, double bone) const;

 private:
  /// U and its derivatives with respect to the two line integrals.
  struct Sum {
    double u = 0.0;
    double by_water = 0.0;
    double by_bone = 0.0;
  };
  [[nodiscard]] Sum summed(double water, double bone) const;

  std::vector<HardeningBin> bins_;
  HardeningPolynomial polynomial_{};
};

}  // namespace af
