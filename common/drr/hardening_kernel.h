// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Total attenuation U of a ray for a tube's spectrum, as a polynomial of two coordinates. x says
/// how much the ray hardens the beam. x leaves little open; a says which of the two materials does
/// it. With water w and bone b of a ray, both as line integrals at the effective energy,
///
///     x = log2(1 + hard . (w, b)) log_scale,    0 at w = b = 0 and 1 at the reaches
///     a = tilt . (w, b)
///     U = straight . (w, b) + x sum_j a^j sum_i c_ij (2 x - 1)^i
///
/// fitted_hardening() finds the numbers.
struct HardeningPolynomial {
  static constexpr int kPowers = 4;                       ///< powers of a: j
  static constexpr int kTerms[kPowers] = {8, 5, 3, 2};    ///< terms of each: i
  static constexpr int kFirst[kPowers] = {0, 8, 13, 16};  ///< in `terms`
  static constexpr int kAllTerms = 18;

  float hard[2];  ///< water, bone
  float tilt[2];
  float straight[2];
  float log_scale;
  float slope_of_air;  ///< dU / dw at 0
  float reach[2];      ///< largest w and b; beyond, U continues straight
  float terms[kAllTerms];
};

/// Turns pixels of the whole CT, and of its bone, into U, in place.
using HardenPixels = void (*)(const HardeningPolynomial& polynomial,
                              int64_t count,
                              float* all,
                              const float* bone);

/// The same with derivatives of both: `planes` planes of that many values, one after the other.
using HardenWithSlopes = void (*)(const HardeningPolynomial& polynomial,
                                  int64_t count,
                                  float* all,
                                  const float* bone,
                                  int32_t planes,
                                  float* all_slopes,
                                  const float* bone_slopes);

#define AF_DECLARE_KERNELS(space)                                \
  namespace space {                                              \
  void harden_pixels(const HardeningPolynomial& polynomial,      \
                     int64_t count,                              \
                     float* all,                                 \
                     const float* bone);                         \
  void harden_with_slopes(const HardeningPolynomial& polynomial, \
                          int64_t count,                         \
                          float* all,                            \
                          const float* bone,                     \
                          int32_t planes,                        \
                          float* all_slopes,                     \
                          const float* bone_slopes);             \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
