// SPDX-License-Identifier: Apache-2.0
// Defect correction: registration by look-up ends at a pose slightly off ray casting's, because the
// field interpolates and quantises. At the end one DRR per view is cast; what look-up lacks of it
// is added to every looked-up DRR, and the last stage converges again, until the pose stands still.
#pragma once

#include <memory>
#include <vector>

#include "base/described_fields.h"
#include "drr/corrected_drr.h"
#include "register/method/correction_report.h"
#include "register/problem/multi_view_objective.h"

namespace af::registration {

struct CorrectionOptions {
  bool is_wanted = false;
  /// A pose that moves no more, mean over the target box, stands still.
  double tolerance_mm = 0.002;
  int max_casts = 4;  ///< ray-cast DRRs per view

  void describe(Fields& field);
  /// The first cast has no slopes, unless it is the only one: the pose moves most after it, with
  /// one view by millimetres, and there the derivatives are others.
  [[nodiscard]] DefectSlopes slopes_of_cast(int casts_before) const;
};

/// Of options that ask for one where rays are cast anyway.
inline constexpr const char* kCorrectsRayCasting =
    "--correct = set: must not be given with --renderer raycast, whose DRRs are ray-cast already";

/// What the looked-up DRRs of a stage lack of ray-cast ones.
class StageDefect {
 public:
  /// `ray_casts`: per view of `stage`. Slopes are about `pivot_room_point`.
  StageDefect(std::vector<ObjectiveView> stage,
              std::vector<std::shared_ptr<const DrrRenderer>> ray_casts,
              const Eigen::Vector3d& pivot_room_point);

  /// Casts a DRR per view, with derivatives for DefectSlopes::Taken; else the slopes stay those of
  /// the pose where they were taken. False when the pose is outside a field: nothing changes.
  bool measure(const RigidTransform& room_from_ct, DefectSlopes slopes);
  /// The stage's views by look-up and the defect.
  [[nodiscard]] std::vector<ObjectiveView> corrected_views() const;
  /// See CorrectionReport.
  [[nodiscard]] double rms() const { return rms_; }
  [[nodiscard]] double change() const { return change_; }

 private:
  /// rms() and change(), now that `next` replaces the defects.
  void compare_with(const std::vector<DrrDefect>& next);

  std::vector<ObjectiveView> stage_;
  std::vector<std::shared_ptr<const DrrRenderer>> ray_casts_;
  Eigen::Vector3d pivot_room_point_;
  std::vector<DrrDefect> defects_;  ///< per view; none before the first measurement
  double rms_ = CorrectionReport::kNone;
  double change_ = CorrectionReport::kNone;
};

}  // namespace af::registration
