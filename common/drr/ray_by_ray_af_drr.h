// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "drr/drr_renderer.h"
#include "drr/field_level.h"
#include "field/compressed_attenuation_field.h"

namespace af {

enum class FieldInterpolation { Nearest, Quadrilinear };

/// DRRs by look-up in a compressed field (Sec. II-B). Each ray's (u,v,s,t) is found per slab, and
/// takes the nearest node or interpolates over 16 neighbours. Nodes are decoded straight from the
/// codebook, or once for all where it has a filter. The slabs' contributions add. \test
/// RayByRayAfDrr.ReproducesMultilinearFieldExactly
class RayByRayAfDrr final : public DrrRenderer {
 public:
  explicit RayByRayAfDrr(std::shared_ptr<const CompressedAttenuationField> field,
                         FieldInterpolation interpolation = FieldInterpolation::Quadrilinear);

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::int64_t rays_outside(const RigidTransform& room_from_ct,
                                          const View& view) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return "field"; }
  [[nodiscard]] const CompressedAttenuationField& field() const { return *field_; }

 private:
  std::shared_ptr<const CompressedAttenuationField> field_;
  std::optional<FieldLevel> decoded_;  ///< where the codebook has a filter
  FieldInterpolation interpolation_;
};

}  // namespace af
