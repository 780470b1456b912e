// SPDX-License-Identifier: Apache-2.0
#include "drr/corrected_drr.h"

#include <cstddef>
#include <utility>

#include "base/error.h"

namespace af {
namespace {

void add_scaled(const float* from, double factor, std::span<float> to) {
  const auto scale = static_cast<float>(factor);
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += scale * from[i];
}

/// A DRR with its derivatives, or without.
struct Rendered {
  std::vector<float> values;
  std::vector<float> planes;
  bool is_inside = false;
};

Rendered rendered(const DrrRenderer& renderer,
                  const RigidTransform& room_from_ct,
                  const View& view,
                  const Eigen::Vector3d& pivot_room_point,
                  DefectSlopes slopes) {
  Rendered result;
  result.values.resize(view.pixel_count());
  std::optional<PoseGradients> gradients;
  if (slopes == DefectSlopes::Taken) {
    result.planes.resize(6 * view.pixel_count());
    gradients = PoseGradients{pivot_room_point, result.planes};
  }
  const auto workspace = renderer.make_workspace();
  result.is_inside =
      renderer.render(room_from_ct, view, *workspace, result.values, gradients).is_inside();
  return result;
}

}  // namespace

std::optional<DrrDefect> drr_defect(const DrrRenderer& reference,
                                    const DrrRenderer& renderer,
                                    const RigidTransform& room_from_ct,
                                    const View& view,
                                    const Eigen::Vector3d& pivot_room_point,
                                    DefectSlopes slopes) {
  const Rendered mine = rendered(renderer, room_from_ct, view, pivot_room_point, slopes);
  if (!mine.is_inside) return std::nullopt;
  Rendered defect = rendered(reference, room_from_ct, view, pivot_room_point, slopes);
  if (!defect.is_inside) return std::nullopt;
  add_scaled(mine.values.data(), -1.0, defect.values);
  add_scaled(mine.planes.data(), -1.0, defect.planes);
  return DrrDefect{
      room_from_ct, std::move(defect.values), pivot_room_point, std::move(defect.planes)};
}

CorrectedDrr::CorrectedDrr(std::shared_ptr<const DrrRenderer> renderer, DrrDefect defect)
    : renderer_(std::move(renderer)), defect_(std::move(defect)) {
  check(defect_.slopes.empty() || defect_.slopes.size() == 6 * defect_.values.size(),
        "six planes of slopes");
}

const float* CorrectedDrr::slope_plane(int parameter) const {
  return defect_.slopes.data() + static_cast<std::size_t>(parameter) * defect_.values.size();
}

void CorrectedDrr::add_values(const RigidTransform& room_from_ct, std::span<float> values) const {
  add_scaled(defect_.values.data(), 1.0, values);
  if (defect_.slopes.empty()) return;
  const Eigen::Vector3d& pivot = defect_.pivot_room_point;
  const PoseParameters moved = parameters_from_pose({Eigen::Matrix3d::Identity(), pivot, pivot},
                                                    room_from_ct * defect_.room_from_ct.inverse());
  for (int k = 0; k < 3; ++k) {
    add_scaled(slope_plane(k), moved.rotation_rad[k], values);
    add_scaled(slope_plane(3 + k), moved.translation_mm[k], values);
  }
}

void CorrectedDrr::add_slopes(const PoseGradients& gradients) const {
  if (defect_.slopes.empty()) return;
  const std::size_t pixels = defect_.values.size();
  const auto plane = [&](int parameter) {
    return gradients.planes.subspan(static_cast<std::size_t>(parameter) * pixels, pixels);
  };
  for (int k = 0; k < 6; ++k) add_scaled(slope_plane(k), 1.0, plane(k));
  // Turning about the one point is turning about the other and a translation.
  const Eigen::Vector3d arm = defect_.pivot_room_point - gradients.pivot_room_point;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d translation = Eigen::Vector3d::Unit(k).cross(arm);
    for (int j = 0; j < 3; ++j) add_scaled(slope_plane(3 + j), translation[j], plane(k));
  }
}

RenderStatus CorrectedDrr::render(const RigidTransform& room_from_ct,
                                  const View& view,
                                  RenderWorkspace& workspace,
                                  std::span<float> total_attenuation,
                                  const std::optional<PoseGradients>& gradients) const {
  check(total_attenuation.size() == defect_.values.size(), "the view is the defect's");
  const RenderStatus status =
      renderer_->render(room_from_ct, view, workspace, total_attenuation, gradients);
  if (!status.is_inside()) return status;
  add_values(room_from_ct, total_attenuation);
  if (gradients) add_slopes(*gradients);
  return status;
}

std::unique_ptr<RenderWorkspace> CorrectedDrr::make_workspace() const {
  return renderer_->make_workspace();
}

}  // namespace af
