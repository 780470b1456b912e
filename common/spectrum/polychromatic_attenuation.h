// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "spectrum/tissue_model.h"
#include "spectrum/xray_spectrum.h"

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
/// Values come from a table of the sum and its derivatives, interpolated by cubic Hermite patches,
/// and are within kTolerance of the sum up to 16 of water and 16 of bone; beyond that the sum
/// itself is taken. \test PolychromaticAttenuation.IsWithinItsToleranceOfTheSum
class PolychromaticAttenuation {
 public:
  /// Largest difference of at() from exactly(), in U.
  static constexpr double kTolerance = 1e-4;

  struct Value {
    double attenuation = 0.0;  ///< U
    double by_all = 0.0;       ///< dU / d all, where bone stays
    double by_bone = 0.0;      ///< dU / d bone, where all stays: water becomes bone
  };

  PolychromaticAttenuation(const SpectrumOptions& options, const TissueModel& tissue);

  /// `all`: line integral at the effective energy, bone included (an ordinary DRR); `bone`: bone's
  /// part of it. Noise beyond what can be is cut off: bone below 0 counts as 0, and above all as
  /// all; all below 0 is continued by its slope at 0. Derivatives are those of what is returned.
  [[nodiscard]] Value at(double all, double bone) const;
  /// The same by the sum over the spectrum.
  [[nodiscard]] Value exactly(double all, double bone) const;

 private:
  /// U and its derivatives by the two line integrals.
  struct Node {
    double u = 0.0;
    double by_water = 0.0;
    double by_bone = 0.0;
    double by_both = 0.0;
  };
  struct Bin {
    double weight;
    double water;  ///< k_water
    double bone;
  };
  template <typename Function>
  [[nodiscard]] Value within_limits(double all, double bone, const Function& node_at) const;
  /// To single precision: the last bits of exp() and log() differ between processors, DRRs do not.
  static Node rounded(const Node& node);
  [[nodiscard]] Node summed(double water, double bone) const;
  [[nodiscard]] Node interpolated(double water, double bone) const;

  std::vector<Bin> bins_;
  std::vector<Node> nodes_;  ///< [water][bone]
};

}  // namespace af
