// SPDX-License-Identifier: Apache-2.0
#include "register/method/correction.h"

#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "base/error.h"

namespace af::registration {

void CorrectionOptions::describe(Fields& field) {
  field.start_group("Method");
  field(
      "correct",
      is_wanted,
      "Correct the end by ray casting: cast a DRR per view there, add what look-up lacks of it to "
      "every looked-up DRR, let the last stage converge again, and repeat until the pose stands "
      "still. It is then close to where ray casting ends. Needs the CT. Costs, at the last "
      "stage's pixels, one ray-cast DRR per view and cast, with derivatives from the second cast "
      "on: a tenth of a second, or a few");
  field("correct_tolerance_mm",
        tolerance_mm,
        "With --correct: a pose that moves no more, mean over the target box, stands still, mm")
      .above(0.0)
      .finite();
  field("correct_max_casts", max_casts, "With --correct: most casts").within(1, 100);
  field.start_group("");
}

DefectSlopes CorrectionOptions::slopes_of_cast(int casts_before) const {
  return casts_before > 0 || max_casts == 1 ? DefectSlopes::Taken : DefectSlopes::LeftOut;
}

StageDefect::StageDefect(std::vector<ObjectiveView> stage,
                         std::vector<std::shared_ptr<const DrrRenderer>> ray_casts,
                         const Eigen::Vector3d& pivot_room_point)
    : stage_(std::move(stage)),
      ray_casts_(std::move(ray_casts)),
      pivot_room_point_(pivot_room_point) {
  check(stage_.size() == ray_casts_.size(), "a ray caster for every view");
}

bool StageDefect::measure(const RigidTransform& room_from_ct, DefectSlopes slopes) {
  std::vector<DrrDefect> next;
  for (std::size_t i = 0; i < stage_.size(); ++i) {
    std::optional<DrrDefect> defect = drr_defect(*ray_casts_[i],
                                                 *stage_[i].renderer,
                                                 room_from_ct,
                                                 stage_[i].view,
                                                 pivot_room_point_,
                                                 slopes);
    if (!defect.has_value()) return false;
    next.push_back(std::move(*defect));
  }
  compare_with(next);
  if (slopes == DefectSlopes::LeftOut)
    for (std::size_t i = 0; i < defects_.size(); ++i)
      next[i].slopes = std::move(defects_[i].slopes);
  defects_ = std::move(next);
  return true;
}

void StageDefect::compare_with(const std::vector<DrrDefect>& next) {
  double sum = 0.0;
  double changed = 0.0;
  double pixels = 0.0;
  for (std::size_t i = 0; i < next.size(); ++i) {
    pixels += static_cast<double>(next[i].values.size());
    for (std::size_t k = 0; k < next[i].values.size(); ++k) {
      const auto value = static_cast<double>(next[i].values[k]);
      sum += value * value;
      if (!defects_.empty())
        changed += std::pow(value - static_cast<double>(defects_[i].values[k]), 2);
    }
  }
  rms_ = std::sqrt(sum / pixels);
  if (!defects_.empty()) change_ = std::sqrt(changed / sum);
}

std::vector<ObjectiveView> StageDefect::corrected_views() const {
  std::vector<ObjectiveView> views = stage_;
  for (std::size_t i = 0; i < views.size(); ++i)
    views[i].renderer = std::make_shared<const CorrectedDrr>(stage_[i].renderer, defects_[i]);
  return views;
}

}  // namespace af::registration
