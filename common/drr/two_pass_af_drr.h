// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "drr/drr_renderer.h"
#include "drr/field_level.h"
#include "drr/viewpoint_blender.h"

namespace af {

/// DRRs by look-up in two cheap passes per slab. All rays of a DRR meet in the source, so a ray's
/// (u,v) is an affine function of its (s,t): first the four viewpoints around it are blended once
/// per (s,t) node of the detector's footprint, then that image is resampled to the detector
/// bilinearly through one homography. Differs from the paper: (u,v) weights are taken at the (s,t)
/// nodes instead of at the ray itself. Against ray casting both are equally good; AfDrr is the
/// literal quadrilinear look-up and this class's oracle. \test
/// TwoPassAfDrr.AgreesWithQuadrilinearLookup
class TwoPassAfDrr final : public DrrRenderer {
 public:
  explicit TwoPassAfDrr(std::shared_ptr<const CompressedAttenuationField> field);
  /// A level of an image pyramid; it inherits the field's coverage.
  explicit TwoPassAfDrr(std::shared_ptr<const FieldLevel> level);

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return "field"; }

 private:
  std::unique_ptr<const ViewpointBlender> blender_;
};

}  // namespace af
