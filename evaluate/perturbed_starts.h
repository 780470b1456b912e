// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/shared_array.h"
#include "geometry/rigid_transform.h"
#include "geometry/slab_sizing.h"

namespace af::evaluation {

/// How starts are drawn: as many as wanted in every interval of initial TRE (Sec. IV-B: eight
/// intervals of 2 mm, 30 starts each).
struct StartOptions {
  int intervals = 8;
  double interval_width_mm = 2.0;
  int starts_per_interval = 30;
  std::uint64_t seed = 1;
};

std::vector<std::string> problems(const StartOptions& options);

/// What the starts of one case are relative to.
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

/// Draw `index` of a case: a direction uniform in the six parameters, rotations scaled by the
/// target box's RMS radius about c_roi, and a magnitude uniform in [0, largest_magnitude_mm).
/// Depends on (seed, case name, index) alone.
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
  /// Its place in the random order of the starts of its interval, from 0: a smaller study takes the
  /// starts of low rank and so a random part of this one.
  int rank_in_interval = 0;
};

/// Mean TREs of poses against the gold pose, in their order: for millions of starts the caller may
/// share the work. Each must be what mean_tre_mm() gives.
using MeasureTres =
    std::function<std::vector<double>(std::span<const RigidTransform> room_from_ct)>;

struct StratifiedStarts {
  SharedArray<PerturbedStart> starts;  ///< by interval, then draw index
  std::uint64_t draws = 0;
  std::uint64_t inadmissible_draws = 0;  ///< refused by the predicate
  std::uint64_t draws_beyond = 0;        ///< initial TRE past the last interval
  /// Refused by the predicate, by the interval that the draw would have been in; a start counts in
  /// full intervals, too.
  std::vector<std::uint64_t> inadmissible_per_interval;
};

/// The paper's rule: draws until every interval has enough, then picks at random that many in each.
/// `is_admissible` says whether registrations may start at a pose. Throws InputError when an
/// interval stays too empty after 1000 draws per wanted start (at least 100000): the predicate
/// leaves too little room there. `measure_tres`, when given, measures the starts that were picked.
/// \test PerturbedStarts.FillEveryIntervalWithExactlyTheStatedCount
StratifiedStarts stratified_starts(
    const StartFrame& frame,
    const StartOptions& options,
    std::span<const Eigen::Vector3d> target_points_ct_mm,
    const std::function<bool(const RigidTransform& room_from_ct)>& is_admissible,
    const MeasureTres& measure_tres = {});

/// As many starts in all, with initial TREs uniform over all intervals together: start i has a TRE
/// of its own, drawn by (seed, case name, i), and a direction that is drawn again while
/// `is_admissible` refuses it, so that the distribution stays uniform. Throws InputError after 1000
/// refusals of one start. \test PerturbedStarts.UniformInTreHaveThatDistribution
StratifiedStarts uniform_starts(
    const StartFrame& frame,
    const StartOptions& options,
    std::span<const Eigen::Vector3d> target_points_ct_mm,
    const std::function<bool(const RigidTransform& room_from_ct)>& is_admissible);

/// The starts at given poses, in their order; intervals may lie beyond the last one.
/// `measure_tres`: as for stratified_starts().
StratifiedStarts starts_at(const StartFrame& frame,
                           const StartOptions& options,
                           std::span<const Eigen::Vector3d> target_points_ct_mm,
                           std::span<const RigidTransform> poses,
                           const MeasureTres& measure_tres = {});

}  // namespace af::evaluation
