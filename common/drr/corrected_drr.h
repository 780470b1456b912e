// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "drr/drr_renderer.h"

namespace af {

/// What one renderer's DRRs of a view lack of another's near a pose.
struct DrrDefect {
  RigidTransform room_from_ct = RigidTransform::Identity();  ///< the pose
  std::vector<float> values;                                 ///< one per pixel, row-major
  Eigen::Vector3d pivot_room_point = Eigen::Vector3d::Zero();
  std::vector<float> slopes;  ///< six planes of pixels as PoseGradients; none: taken for 0
};

enum class DefectSlopes { Taken, LeftOut };

/// `reference` less `renderer`, with slopes about `pivot_room_point`; nullopt where rays are
/// outside.
std::optional<DrrDefect> drr_defect(const DrrRenderer& reference,
                                    const DrrRenderer& renderer,
                                    const RigidTransform& room_from_ct,
                                    const View& view,
                                    const Eigen::Vector3d& pivot_room_point,
                                    DefectSlopes slopes);

/// DRRs of another renderer with a defect added: at the defect's pose the reference's DRR, and with
/// slopes the reference's derivatives; nearby both to first order.
/// \test CorrectedDrr.IsTheReferenceWhereTheDefectWasTaken
class CorrectedDrr final : public DrrRenderer {
 public:
  /// It renders the defect's view only.
  CorrectedDrr(std::shared_ptr<const DrrRenderer> renderer, DrrDefect defect);

  /// Where rays are outside, nothing is added: their pixels are 0.
  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients = std::nullopt) const override;
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override;
  [[nodiscard]] const char* name() const override { return renderer_->name(); }

 private:
  void add_values(const RigidTransform& room_from_ct, std::span<float> values) const;
  void add_slopes(const PoseGradients& gradients) const;
  [[nodiscard]] const float* slope_plane(int parameter) const;

  std::shared_ptr<const DrrRenderer> renderer_;
  DrrDefect defect_;
};

}  // namespace af
