// SPDX-License-Identifier: Apache-2.0
// The paper's formulas for the sides of the planes, an oracle of make_light_slab().
#pragma once

#include <cmath>
#include <string>

#include "base/error.h"
#include "geometry/motion_range.h"
#include "geometry/rigid_transform.h"

namespace af::test {

/// The paper's symmetric special case: eqs. (3)-(10) for a camera on the y axis moved by T = T_t Rz
/// Ry Rx.
struct SymmetricPlaneSizes {
  double uv_side_mm = 0.0;
  double st_side_mm = 0.0;
};

struct SymmetricCamera {
  double half_field_of_view_rad = 0.0;  ///< phi
  double plane_separation_mm = 650.0;   ///< f
};

/// Shared terms of eqs. (4)-(10): K of eq. (6) and its denominator D.
struct ClosedFormTerms {
  double cosine, sine, tangent, denominator, k_term;
};

inline ClosedFormTerms closed_form_terms(const SymmetricCamera& camera, const MotionRange& range) {
  const double c = std::cos(range.max_rotation_rad());
  const double s = std::sin(range.max_rotation_rad());
  const double k = std::tan(camera.half_field_of_view_rad);
  const double denominator = c * c - s * s * s - k * c * s * (2.0 + s);
  if (!(denominator > 0.0))
    throw InputError("max_rotation_deg",
                     std::to_string(range.max_rotation_rad() * kDegPerRad),
                     "too large: the extreme ray runs parallel to the field's planes");
  return {
      c, s, k, denominator, (k * (c * c - s * s + c * c * s) + c * s * (1.0 + s)) / denominator};
}

/// Closed form, eqs. (4)-(6), (8)-(9). Throws InputError when the range makes the denominator D <=
/// 0.
inline SymmetricPlaneSizes closed_form_plane_sizes(const SymmetricCamera& camera,
                                                   const MotionRange& range) {
  const ClosedFormTerms terms = closed_form_terms(camera, range);
  const double c = terms.cosine;
  const double s = terms.sine;
  const double f = camera.plane_separation_mm;
  const double moved = range.max_translation_mm() * (1.0 + terms.k_term);
  return {2.0 * (moved + f * s * (1.0 + s) * (c + s * terms.k_term)),
          2.0 * (moved + f * terms.tangent * (c * c + s) / terms.denominator)};
}

/// Small-angle form, eqs. (7), (10).
inline SymmetricPlaneSizes small_angle_plane_sizes(const SymmetricCamera& camera,
                                                   const MotionRange& range) {
  const double phi = camera.half_field_of_view_rad;
  const double angle = range.max_rotation_rad();
  const double f = camera.plane_separation_mm;
  const double moved = range.max_translation_mm() * (1.0 + phi + angle);
  return {2.0 * (moved + f * angle * (1.0 + angle)), 2.0 * (moved + f * phi * (1.0 + angle))};
}

}  // namespace af::test
