// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "geometry/light_slab.h"
#include "precompute/casting/field_caster.h"

namespace af {

/// Fewest viewpoints along an axis between which there is something to fit.
inline constexpr int kFewestFittedViewpoints = 3;

/// Casts a field whose samples are not the line integrals at its viewpoints. They are the values
/// between which linear interpolation over (u,v) comes nearest to the line integrals everywhere:
/// nearly the projection on linear splines. (Interpolation of a curved function errs to one side
/// within a cell. With these samples it errs to both sides equally, and by 8 dB less.)
///
/// Along an axis, the best line through a cell with line integrals f(0), f(1/2), f(1), which
/// Simpson's rule weights by 1/6, 4/6, 1/6, begins at (2 f(0) + 2 f(1/2) - f(1)) / 3. A sample is
/// the mean of the lines of the cells on both sides of its viewpoint. The changes along u and along
/// v are added, so line integrals are cast between two viewpoints, but not between four. Samples
/// are at least 0. \test LeastSquaresCaster.*
class LeastSquaresFieldCaster final : public FieldCaster {
 public:
  /// A caster of line integrals for planes that outlive it.
  using MakeCaster = std::function<std::unique_ptr<const FieldCaster>(const LightSlab& planes)>;

  /// `light_slab` must outlive the caster. Throws InputError with fewer than
  /// kFewestFittedViewpoints.
  LeastSquaresFieldCaster(const LightSlab& light_slab, const MakeCaster& make_caster);
  // Copies are forbidden because the casters refer to members.
  LeastSquaresFieldCaster(const LeastSquaresFieldCaster&) = delete;
  LeastSquaresFieldCaster& operator=(const LeastSquaresFieldCaster&) = delete;

  void cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const override;

  /// How many line integrals a cast of the unit holds at once, at most.
  static std::size_t held_samples(const WorkUnit& unit);

 private:
  NodeRange u_nodes_;
  NodeRange v_nodes_;
  LightSlab between_u_;  ///< viewpoints midway between neighbours along u
  LightSlab between_v_;
  std::unique_ptr<const FieldCaster> at_viewpoints_;
  std::unique_ptr<const FieldCaster> at_between_u_;
  std::unique_ptr<const FieldCaster> at_between_v_;
};

}  // namespace af
