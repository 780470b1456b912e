// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/slab_sizing.h"
#include "register/optimizer/optimizer.h"
#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// Motion box of a field: poses beyond it are inadmissible.
struct MotionLimit {
  PoseFrame frame;
  MotionRange range;
};

/// One view as an objective sees it; the pointers' targets outlive the objective.
struct ObjectiveView {
  View view;
  std::shared_ptr<const DrrRenderer> renderer;
  std::shared_ptr<const SimilarityMeasure> measure;
  std::optional<MotionLimit> limit;  ///< none for ray casting
};

struct ObjectiveValue {
  double similarity = 0.0;        ///< sum over views; NaN when inadmissible
  bool is_admissible = false;     ///< inside every view's limit and no ray outside a field
  std::int64_t rays_outside = 0;  ///< of the first view that has any
  int drr_count = 0;              ///< DRRs rendered for this value
};

/// Eq. (13): sum of the views' similarities at a pose. Owns the scratch memory: one objective per
/// thread; evaluations do not allocate (those with derivatives: after the first).
class MultiViewObjective {
 public:
  explicit MultiViewObjective(std::vector<ObjectiveView> views);

  ObjectiveValue evaluate(const RigidTransform& room_from_ct);

  /// With derivatives, into `result`: by small motions of the CT in the room about
  /// `pivot_room_point`, as PoseGradients (per rad, per mm). Derivatives::Gradient leaves the
  /// matrix 0. The measures must have what is asked for.
  ObjectiveValue evaluate_with(const RigidTransform& room_from_ct,
                               const Eigen::Vector3d& pivot_room_point,
                               Derivatives derivatives,
                               NormalEquations& result);

  [[nodiscard]] const std::vector<ObjectiveView>& views() const { return views_; }

 private:
  struct Scratch {
    std::unique_ptr<RenderWorkspace> render;
    std::unique_ptr<SimilarityWorkspace> similarity;
    std::vector<float> drr;
    std::vector<float> planes;    ///< six, once derivatives were asked for
    std::vector<float> by_pixel;  ///< likewise
  };
  [[nodiscard]] bool is_in_range(const RigidTransform& room_from_ct) const;

  std::vector<ObjectiveView> views_;
  std::vector<Scratch> scratch_;
};

}  // namespace af::registration
