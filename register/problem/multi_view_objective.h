// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/thread_pool.h"
#include "drr/drr_renderer.h"
#include "geometry/motion_range.h"
#include "register/optimizer/optimizer.h"
#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// Motion box of a field: poses beyond it are inadmissible.
struct MotionLimit {
  PoseFrame frame;
  MotionRange range;

  [[nodiscard]] ParameterSet beyond(const RigidTransform& room_from_ct) const {
    return range.beyond(parameters_from_pose(frame, room_from_ct));
  }
};

/// One view as an objective sees it. The targets of its pointers must outlive the objective.
struct ObjectiveView {
  View view;
  std::shared_ptr<const DrrRenderer> renderer;
  std::shared_ptr<const SimilarityMeasure> measure;
  std::optional<MotionLimit> limit;  ///< none for ray casting
};

struct ObjectiveValue {
  double similarity = 0.0;        ///< sum over views; NaN when inadmissible
  bool is_admissible = false;     ///< inside every view's limit and no ray outside a field
  std::int64_t rays_outside = 0;  ///< in the first view that has any
  int drr_count = 0;              ///< DRRs rendered for this value
};

/// The gradient of one view's similarity, split over the tiles of its region, row by row. The parts
/// sum to the view's gradient. It is with respect to small motions of the CT in the room, as in
/// PoseGradients (per rad, per mm).
using TileScores = std::vector<PoseVector>;

/// Eq. (13): the sum of the views' similarities at a pose. It owns the scratch memory. Only one
/// objective at a time may use a pool of threads, over which views and poses are spread. Values do
/// not depend on the number of threads. Only the first evaluations of a kind allocate.
class MultiViewObjective {
 public:
  /// `pool`: none means the calling thread alone.
  explicit MultiViewObjective(std::vector<ObjectiveView> views,
                              std::shared_ptr<ThreadPool> pool = nullptr);

  ObjectiveValue evaluate(const RigidTransform& room_from_ct);
  /// One value per pose.
  void evaluate_all(std::span<const RigidTransform> room_from_ct, std::span<ObjectiveValue> values);

  /// Evaluates with derivatives, into `result`. They are with respect to small motions of the CT in
  /// the room about `pivot_room_point`, as in PoseGradients (per rad, per mm).
  /// Derivatives::Gradient leaves the matrix 0. The measures must be LeastSquaresMeasures, or
  /// DifferentiableMeasures for a Gradient.
  ObjectiveValue evaluate_with(const RigidTransform& room_from_ct,
                               const Eigen::Vector3d& pivot_room_point,
                               Derivatives derivatives,
                               NormalEquations& result);

  /// Evaluates the views one by one. The gradient of each is split over `tiles` x `tiles` parts of
  /// its region, as sums of (derivative by a DRR pixel) x (derivative of that pixel by the pose).
  /// The measures must be DifferentiableMeasures. `scores`: one per view, unchanged when the pose
  /// is inadmissible.
  ObjectiveValue evaluate_scores(const RigidTransform& room_from_ct,
                                 const Eigen::Vector3d& pivot_room_point,
                                 int tiles,
                                 std::vector<TileScores>& scores);

  /// The parameters along which a pose is beyond the limit of any view.
  [[nodiscard]] ParameterSet beyond_limits(const RigidTransform& room_from_ct) const;
  /// The pose, or the nearest one within the limits of all views, parameter by parameter.
  [[nodiscard]] RigidTransform nearest_within_limits(const RigidTransform& room_from_ct) const;

  /// Says before a search whether evaluations may make DRRs from node images of earlier ones
  /// (RenderWorkspace::reuse_images()). If so, values depend on earlier poses until this is called
  /// again or several poses are evaluated at once.
  void reuse_images(bool is_allowed);

  [[nodiscard]] const std::vector<ObjectiveView>& views() const { return views_; }
  [[nodiscard]] const std::shared_ptr<ThreadPool>& pool() const { return pool_; }

 private:
  /// Memory for one view and thread.
  struct Scratch {
    std::unique_ptr<RenderWorkspace> render;
    std::unique_ptr<SimilarityWorkspace> similarity;
    std::vector<float> drr;
    std::vector<float> planes;    ///< six, once derivatives have been asked for
    std::vector<float> by_pixel;  ///< likewise
  };
  /// What is known about one pose before its views are summed.
  struct PoseState {
    bool is_in_range = false;
    int first_outside = 0;  ///< first view with rays outside; later ones do not count
  };
  /// The contribution of one view to the value of one pose.
  struct Part {
    std::int64_t rays_outside = 0;
    NormalEquations equations;  ///< or only the value
  };

  void prepare(std::span<const RigidTransform> room_from_ct);
  Scratch& scratch_of(int slot, std::size_t view);
  /// Renders a view of pose `i` and lets `compare` fill its part, unless an earlier view of the
  /// pose is known to have rays outside.
  template <typename Compare>
  void evaluate_view(std::size_t i,
                     const RigidTransform& room_from_ct,
                     std::size_t view,
                     Scratch& scratch,
                     const std::optional<PoseGradients>& gradients,
                     const Compare& compare);
  /// Forgets node images if pose `i` has rays outside. Which of its views were rendered depends on
  /// the threads, and must not affect later values.
  void forget_images_of_refused(std::size_t i);
  /// The sum over the views of pose `i`, in order.
  [[nodiscard]] ObjectiveValue sum_of(std::size_t i, NormalEquations& equations) const;

  std::vector<ObjectiveView> views_;
  std::shared_ptr<ThreadPool> pool_;
  std::vector<Scratch> scratch_;  ///< [thread][view], made when first used
  bool reuses_images_ = false;
  std::vector<PoseState> poses_;  ///< reused
  std::vector<Part> parts_;       ///< [pose][view], reused
};

}  // namespace af::registration
