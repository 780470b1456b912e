// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/slab_sizing.h"
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
/// thread; evaluate() does not allocate.
class MultiViewObjective {
 public:
  explicit MultiViewObjective(std::vector<ObjectiveView> views);

  ObjectiveValue evaluate(const RigidTransform& room_from_ct);

  [[nodiscard]] const std::vector<ObjectiveView>& views() const { return views_; }

 private:
  struct Scratch {
    std::unique_ptr<RenderWorkspace> render;
    std::unique_ptr<SimilarityWorkspace> similarity;
    std::vector<float> drr;
  };
  std::vector<ObjectiveView> views_;
  std::vector<Scratch> scratch_;
};

}  // namespace af::registration
