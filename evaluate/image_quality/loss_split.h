// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>

#include "drr/drr_renderer.h"
#include "evaluate/image_quality/interpolated_ray_cast.h"

namespace af::evaluation {

/// What a field's DRR loses at one pose, compared with ray casting: by interpolation over (u,v)
/// alone, over (s,t) alone and over both, by everything after interpolation (16 bits, codebook,
/// caster of the field), and in all. These are mean squared differences over the reference's
/// foreground, in units of its squared maximum. psnr_db = -10 log10(these), as in eq. (12).
struct LossSplit {
  static constexpr std::size_t kParts = 5;
  static constexpr std::array<const char*, kParts> kNames = {
      "uv", "st", "uv_st", "quantisation", "total"};

  std::array<double, kParts> mean_square{};
  auto members() { return std::tie(mean_square); }

  [[nodiscard]] std::array<double, kParts> psnr_db() const;
};

/// Splits the loss of one view's field. One object per thread.
/// \test LossSplitter.AFieldWithoutQuantisationLosesByInterpolationAlone
class LossSplitter {
 public:
  /// Takes the two-pass linear look-up of a field of one slab, and the reference, which must both
  /// outlive this, and ray casting with the interpolation of that field.
  LossSplitter(const DrrRenderer& field,
               const DrrRenderer& reference,
               const InterpolatedRayCast& interpolated,
               const View& view);

  /// NaN when a ray is outside or nothing is in the foreground.
  [[nodiscard]] LossSplit at_pose(const RigidTransform& room_from_ct) const;

 private:
  [[nodiscard]] std::vector<float> rendered(const DrrRenderer& renderer,
                                            const RigidTransform& room_from_ct,
                                            bool& is_inside) const;

  const DrrRenderer& field_;
  const DrrRenderer& reference_;
  InterpolatedRayCast uv_;
  InterpolatedRayCast st_;
  InterpolatedRayCast both_;
  View view_;
};

}  // namespace af::evaluation
