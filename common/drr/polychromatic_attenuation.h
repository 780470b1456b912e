// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "drr/hardening_fit.h"
#include "drr/tissue_model.h"
#include "drr/xray_spectrum.h"

namespace af {

/// What a detector behind a ray sees of a whole spectrum, as total attenuation:
///
///     U = -ln sum_E S(E) exp(-(water k_water(E) + bone k_bone(E))),    k(E) = mu(E) / mu(E_0),
///
/// where water and bone are the ray's line integrals of either at the effective energy E_0 of the
/// HU scale, and S is the detected spectrum of the open beam. Water and bone are TissueModel's. At
/// one energy E_0 it is U = water + bone: the linear HU model. (Basis materials after R. E. Alvarez
/// and A. Macovski, Phys. Med. Biol. 21:733, 1976.)
///
/// Pixels are taken from a polynomial in single precision, by the vector kernels
/// (HardeningPolynomial), and are within tolerance() of the sum up to 12 of water and 8 of bone;
/// beyond that U goes on straight. \test PolychromaticAttenuation.IsWithinItsToleranceOfTheSum
class PolychromaticAttenuation {
 public:
  /// Largest difference from exactly(), in U, for tubes of 60 kV and more behind 1 mm of aluminium
  /// and more; and for all others. Where U exceeds 8, in U / 8.
  static constexpr double kTolerance = 2e-4;
  static constexpr double kToleranceOfSoftBeams = 2e-3;

  struct Value {
    double attenuation = 0.0;  ///< U
    double by_all = 0.0;       ///< dU / d all, where bone stays
    double by_bone = 0.0;      ///< dU / d bone, where all stays: water becomes bone
  };

  PolychromaticAttenuation(const SpectrumOptions& options, const TissueModel& tissue);

  /// `all`: line integrals at the effective energy, bone included (an ordinary DRR); `bone`: bone's
  /// part of them. Turns `all` into U. Impossible values, from noise, are limited: bone below 0
  /// counts as 0, and bone above `all` as `all`; below `all` = 0, U continues with its slope at 0.
  /// Bits do not depend on the vector width.
  void apply(std::span<float> all, std::span<const float> bone) const;
  /// The same, and planes of derivatives of both, one after the other, by the chain rule.
  void apply(std::span<float> all,
             std::span<const float> bone,
             std::span<float> all_slopes,
             std::span<const float> bone_slopes) const;
  /// apply() of one ray.
  [[nodiscard]] Value at(double all, double bone) const;
  /// The same by the sum over the spectrum, for any length.
  [[nodiscard]] Value exactly(double all, double bone) const;

 private:
  /// U and its derivatives by the two line integrals.
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
