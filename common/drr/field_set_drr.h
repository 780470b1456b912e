// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/light_slab.h"

namespace af {

/// One field of a set, and what renders it or one of its levels.
struct FieldSetMember {
  std::shared_ptr<const LightSlab> field_geometry;
  std::shared_ptr<const DrrRenderer> renderer;
};

/// DRRs from several fields of one CT, such as those of a C-arm's angles. A pose is looked up in
/// the field that holds its rays best: where they stay farthest from the planes' edges, as shares
/// of the planes' sizes, multiplied over all axes. Where two fields are nearly as good, both are
/// looked up and their DRRs averaged. The weights are continuous in the pose, so a registration can
/// cross a seam.
/// A DRR depends on its pose alone, not on earlier poses, so results are the same on any number of
/// threads. A pose that no field holds completely is rendered by the field that misses fewest rays.
/// Gradients leave out the change of the weights, which multiplies the difference of two fields'
/// errors. \test FieldSetDrrTest.HasNoJumpAtASeam
class FieldSetDrr final : public DrrRenderer {
 public:
  /// Takes at least one member.
  explicit FieldSetDrr(std::vector<FieldSetMember> members);

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::int64_t rays_outside(const RigidTransform& room_from_ct,
                                          const View& view) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return "field"; }

  /// The weight of each member at a pose. Weights add up to 1, or are all 0 where no member holds
  /// all rays.
  [[nodiscard]] std::vector<double> weights(const RigidTransform& room_from_ct,
                                            const View& view) const;

 private:
  std::vector<FieldSetMember> members_;
};

}  // namespace af
