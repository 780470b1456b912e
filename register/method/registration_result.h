// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "geometry/rigid_transform.h"
#include "register/method/correction.h"
#include "register/optimizer/optimizer.h"

namespace af::registration {

struct TraceRow {
  int pass = 0;  ///< stage, from 0, counted over the chains; a correction comes after them
  double step_mm = 0.0;
  int evaluations = 0;  ///< up to here, over all stages
  double similarity = 0.0;
  PoseParameters parameters;  ///< relative to RegistrationProblem::frame()

  auto members() { return std::tie(pass, step_mm, evaluations, similarity, parameters); }
};

struct RegistrationResult {
  RigidTransform start_room_from_ct = RigidTransform::Identity();
  RigidTransform room_from_ct = RigidTransform::Identity();
  double similarity = 0.0;  ///< at the end: from the chain's last stage; for a portfolio from its
  std::string chain;        ///< from which the result comes
  /// For a portfolio: distance from its choice, before the finish, to the nearest end of another
  /// chain that began at the start, averaged over the target box. NaN when no such end has a value.
  double chain_distance_mm = std::numeric_limits<double>::quiet_NaN();
  int evaluations = 0;            ///< poses tried
  int inadmissible = 0;           ///< how many of these were outside the field or its motion range
  std::int64_t drr_count = 0;     ///< DRRs rendered, including those of a correction
  std::int64_t rays_outside = 0;  ///< at the start, when they make it inadmissible
  StopReason stop_reason = StopReason::StepBelowFinal;
  std::string clipped_along;  ///< "rx, tz": where the start was beyond the motion range; searches
                              ///< began at the range's edge
  std::string pinned_along;   ///< where the motion range ends, for an end that is pinned there
  /// Finishes of ends that were not chosen are left out, except for one that a later one replaced.
  /// Their evaluations count.
  std::vector<TraceRow> trace;
  std::optional<CorrectionReport> correction;  ///< when one was wanted
  double seconds = 0.0;                        ///< wall time

  /// Whether the registration ended with a meaningful pose.
  [[nodiscard]] bool has_pose() const {
    return std::isfinite(similarity) && room_from_ct.matrix().allFinite();
  }

  auto members() {
    return std::tie(start_room_from_ct,
                    room_from_ct,
                    similarity,
                    chain,
                    chain_distance_mm,
                    evaluations,
                    inadmissible,
                    drr_count,
                    rays_outside,
                    stop_reason,
                    clipped_along,
                    pinned_along,
                    trace,
                    correction,
                    seconds);
  }
};

}  // namespace af::registration
