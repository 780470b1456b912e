// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/light_slab.h"

namespace af {

/// One field of a set, and what renders it (or one level of it).
struct FieldSetMember {
  std::shared_ptr<const LightSlab> field_geometry;
  std::shared_ptr<const DrrRenderer> renderer;
};

/// DRRs of several fields of one CT, such as those of a C-arm's angles. A pose is looked up in the
/// field that holds its rays best: whose planes' edges they keep farthest from, as shares of the
/// planes' sizes, along all axes together (their product). Where two are nearly as good, both are
/// looked up, and their DRRs are averaged with weights that are continuous in the pose, so that a
/// registration can cross a seam. What is rendered depends on the pose alone, not on the poses
/// before it: results are the same on any number of threads. A pose that no field holds whole is
/// rendered by the one that misses fewest rays. Gradients leave out how the weights change, which
/// multiplies the difference of two fields' errors. \test FieldSetDrrTest.HasNoJumpAtASeam
class FieldSetDrr final : public DrrRenderer {
 public:
  /// At least one member.
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

  /// Of each member at a pose; they add up to 1, or are all 0 where none holds all rays.
  [[nodiscard]] std::vector<double> weights(const RigidTransform& room_from_ct,
                                            const View& view) const;

 private:
  std::vector<FieldSetMember> members_;
};

}  // namespace af
