// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/shared_array.h"
#include "geometry/ct_box.h"
#include "geometry/motion_range.h"
#include "geometry/rigid_transform.h"
#include "geometry/tre.h"

namespace af::evaluation {

/// How starts are drawn: the same number in every interval of initial TRE (Sec. IV-B: eight
/// intervals of 2 mm, 30 starts each).
struct StartOptions {
  int intervals = 8;
  double interval_width_mm = 2.0;
  int starts_per_interval = 30;
  std::uint64_t seed = 1;
};

std::vector<std::string> problems(const StartOptions& options);

/// The frame of the starts of one case.
struct StartFrame {
  std::string case_name;
  RigidTransform gold_room_from_ct = RigidTransform::Identity();
  Eigen::Vector3d center_ct_mm = Eigen::Vector3d::Zero();  ///< c_roi: origin of the rotations
  CtBox target_box_ct;

  /// Zero parameters give the gold pose; rotations are about c_roi along the room's axes.
  [[nodiscard]] PoseFrame pose_frame() const {
    return PoseFrame::about(gold_room_from_ct, center_ct_mm);
  }
};

/// Draw `index` of a case: a direction uniform in the six parameters, with rotations scaled by the
/// target box's RMS radius about c_roi, and a magnitude uniform in [0, largest_magnitude_mm). It
/// depends only on (seed, case name, index).
PoseParameters draw_perturbation(const StartFrame& frame,
                                 double largest_magnitude_mm,
                                 std::uint64_t seed,
                                 std::uint64_t index);

struct PerturbedStart {
  std::uint64_t draw_index = 0;
  int interval = 0;           ///< from 0: initial TRE in [interval, interval + 1) * width
  PoseParameters parameters;  ///< relative to gold: StartFrame::pose_frame()
  RigidTransform room_from_ct = RigidTransform::Identity();
  double initial_tre_mm = 0.0;
  /// The start's place in the random order of its interval's starts, from 0. A smaller study takes
  /// the starts of low rank, which are a random part of this one.
  int rank_in_interval = 0;
};

/// The share of rotation in a start: the square of its size in mm (angles times the target box's
/// RMS radius), divided by that of rotation and translation together. It is 0 for a pure
/// translation, 1 for a pure rotation, and NaN when nothing moves. Directions uniform in the six
/// parameters have 1/2 on average.
/// \test RotationShare.IsOneHalfWhereNothingIsRefused
double rotation_share(const PoseParameters& parameters, double rms_radius_mm);

/// The motion range of a field: the frame of its poses, and how far they may lie from it.
struct StartLimit {
  PoseFrame frame;
  MotionRange range;
};

/// Whether a registration may start at a pose.
using IsAdmissible = std::function<bool(const RigidTransform& room_from_ct)>;

/// Numbers first, first + 1 ... first + count - 1.
struct IndexRange {
  std::uint64_t first = 0;
  std::uint64_t count = 0;
};

/// Where a draw of stratified_starts() falls.
struct DrawVerdict {
  int interval = 0;           ///< the number of intervals or more: beyond the last one
  bool is_admissible = true;  ///< not asked beyond the last one
};

/// A start of uniform_starts() or starts_within_range().
struct UniformStart {
  PoseParameters parameters;
  double initial_tre_mm = 0.0;
  std::uint64_t refused = 0;  ///< draws before it that were not admissible

  static constexpr std::uint64_t kMostDraws = 1000;
  /// Whether no draw was admissible.
  [[nodiscard]] bool is_exhausted() const { return refused == kMostDraws; }
};

/// Computes single draws or poses.
class StartMeasures {
 public:
  /// The points must outlive it. Throws InputError for invalid options.
  StartMeasures(StartFrame frame,
                const StartOptions& options,
                std::span<const Eigen::Vector3d> target_points_ct_mm,
                IsAdmissible is_admissible,
                std::optional<StartLimit> limit = std::nullopt);
  StartMeasures(const StartMeasures&) = delete;
  StartMeasures& operator=(const StartMeasures&) = delete;

  [[nodiscard]] const StartFrame& frame() const { return frame_; }
  [[nodiscard]] const StartOptions& options() const { return options_; }
  [[nodiscard]] const std::optional<StartLimit>& limit() const { return limit_; }
  [[nodiscard]] double largest_tre_mm() const {
    return options_.intervals * options_.interval_width_mm;
  }

  /// Counts from 0.
  [[nodiscard]] int interval_of(double initial_tre_mm) const;
  /// Draw `draw_index` of stratified_starts().
  [[nodiscard]] PoseParameters stratified_draw(std::uint64_t draw_index) const;

  /// Verdicts in the order of the draws.
  std::vector<DrawVerdict> judge_draws(IndexRange draws);
  /// Mean TREs against the gold pose, in the order of the poses.
  std::vector<double> tres_mm(std::span<const RigidTransform> room_from_ct);
  /// Starts in order. When one is exhausted, nothing is drawn after it.
  std::vector<UniformStart> draw_uniform(IndexRange starts);
  /// The same for starts_within_range(), which needs a limit.
  std::vector<UniformStart> draw_within_range(IndexRange starts);

 private:
  [[nodiscard]] int interval_of_draw(const RigidTransform& room_from_ct) const;
  [[nodiscard]] UniformStart draw_uniform(std::uint64_t index) const;
  [[nodiscard]] UniformStart draw_within_range(std::uint64_t index) const;
  [[nodiscard]] RigidTransform pose_within_range(const PoseParameters& direction,
                                                 double size_mm) const;
  [[nodiscard]] double tre_mm(const RigidTransform& room_from_ct) const;
  [[nodiscard]] double scale_to_tre(double tre_mm, PoseParameters& parameters) const;

  StartFrame frame_;
  StartOptions options_;
  std::span<const Eigen::Vector3d> points_ct_mm_;
  IsAdmissible is_admissible_;
  std::optional<StartLimit> limit_;
  std::vector<TreBounder> bounders_;  ///< coarse to fine; made by the first draw
};

struct StratifiedStarts {
  SharedArray<PerturbedStart> starts;  ///< by interval, then draw index
  std::uint64_t draws = 0;
  std::uint64_t inadmissible_draws = 0;  ///< refused by the predicate
  std::uint64_t draws_beyond = 0;        ///< initial TRE past the last interval
  /// How many draws the predicate refused, by the interval in which they would have been. Draws for
  /// intervals that are already full count too.
  std::vector<std::uint64_t> inadmissible_per_interval;
  /// All draws by the interval in which they would have been, refused or not. Empty when the starts
  /// were not drawn.
  std::vector<std::uint64_t> draws_per_interval;
  /// Mean rotation_share() of the starts; NaN for an interval without any. The draws that a field's
  /// range refuses are mostly rotations, so far starts are mostly translations.
  std::vector<double> rotation_share_per_interval;
};

/// The paper's rule: draws until every interval has enough, then picks the stated number in each at
/// random. Throws InputError when an interval has too few after 1000 draws per wanted start (at
/// least 100000), because what is admissible leaves too little room there.
/// \test PerturbedStarts.FillEveryIntervalWithExactlyTheStatedCount
StratifiedStarts stratified_starts(StartMeasures& measures);

/// The same total number, with initial TREs uniform over all intervals together. Start i has a TRE
/// of its own, drawn by (seed, case name, i). Its direction is drawn again until it is admissible,
/// so the distribution stays uniform. Throws InputError after 1000 refusals of one start.
/// \test PerturbedStarts.UniformInTreHaveThatDistribution
StratifiedStarts uniform_starts(StartMeasures& measures);

/// As many starts in each interval as stratified_starts() gives, inside the measures' limit by
/// design. A start has a direction uniform in the six parameters, as there, and a TRE uniform in
/// the interval. It moves along the direction. Each of the limit's six parameters stops at 98 % of
/// its range, and the others continue until the TRE is reached. A start thus keeps as much rotation
/// as the range allows, and translation provides the rest.
/// A direction that cannot reach the TRE within the range is drawn again and counts as refused. So
/// does one that the predicate refuses (the range of another field). Throws InputError without a
/// limit, for a gold pose outside, and after 1000 refusals of one start; `field` names the rule
/// there. \test PerturbedStarts.WithinRangeLieInsideByDesign
StratifiedStarts starts_within_range(StartMeasures& measures,
                                     const std::string& field = "start_rule");

/// The starts at given poses, in their order. Intervals may lie beyond the last one.
StratifiedStarts starts_at(StartMeasures& measures, std::span<const RigidTransform> poses);

}  // namespace af::evaluation
