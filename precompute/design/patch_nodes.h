// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/casting/field_caster.h"
#include "precompute/casting/unit_tiles.h"
#include "precompute/codebook/nearest_codeword.h"
#include "precompute/design/probe_rays.h"

namespace af {

/// What a look-up gives for the rays of a patch.
struct PatchValues {
  std::array<double, RayPatch::kRays> linear{};
  std::array<double, RayPatch::kRays> cubic{};
};

/// The cast nodes (whole tiles) of one field around one patch of rays, in every slab. Looks the
/// patch up as TwoPassAfDrr does, before and after quantisation, but slab by slab. TwoPassAfDrr
/// first sums slabs on one plane, which is about as good.
/// \test DesignProbeTest.LooksPatchesOfOneSlabUpAsTwoPassAfDrrDoes
class PatchNodes {
 public:
  /// `planes` must outlive it.
  PatchNodes(const FieldCaster& caster,
             const LightSlab& planes,
             float quantizer_step,
             const RayPatch& patch);

  /// Values from the nodes as they were cast, 16 bits each.
  [[nodiscard]] PatchValues values() const { return values_of(samples_); }
  /// Values from the nearest codewords of their tiles.
  [[nodiscard]] PatchValues values(const NearestCodeword& search, const Codebook& codebook) const;

 private:
  using SlabSamples = std::vector<std::vector<std::uint16_t>>;  ///< of every slab [u][v][s][t]

  [[nodiscard]] PatchValues values_of(const SlabSamples& samples) const;
  void add_slab(std::size_t k, const std::vector<std::uint16_t>& samples, PatchValues& sum) const;

  const LightSlab& planes_;
  float quantizer_step_;
  const RayPatch& patch_;
  std::vector<WorkUnit> units_;
  SlabSamples samples_;
};

}  // namespace af
