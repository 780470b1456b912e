// SPDX-License-Identifier: Apache-2.0
#include "register/results/target_errors.h"

#include <vector>

#include "gold_standard/target_box.h"
#include "gold_standard/tre.h"

namespace af::registration {

void add_target_errors(const std::optional<GoldStandard>& gold,
                       const CtBox& target_box_ct,
                       std::vector<RegistrationRecord>& records) {
  if (!gold.has_value()) return;
  const std::vector<Eigen::Vector3d> points = target_points(target_box_ct);
  for (RegistrationRecord& record : records)
    record.errors =
        TargetErrors{gold->source,
                     mean_tre_mm(record.result.start_room_from_ct, gold->room_from_ct, points),
                     mean_tre_mm(record.result.room_from_ct, gold->room_from_ct, points)};
}

}  // namespace af::registration
