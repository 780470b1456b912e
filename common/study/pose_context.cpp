// SPDX-License-Identifier: Apache-2.0
#include "study/pose_context.h"

#include <memory>

#include "study/ct_keys.h"

namespace af {

namespace fs = std::filesystem;

PoseContext pose_context(const fs::path& ct,
                         const CtReadOptions& ct_reading,
                         const std::optional<CameraRig>& rig,
                         const std::optional<PoseFrame>& frame) {
  PoseContext context;
  context.frame = frame;
  if (rig.has_value()) context.rig = [rig] { return *rig; };
  if (ct.empty()) return context;
  const auto grid = std::make_shared<std::optional<CtGrid>>();
  context.ct_grid = [ct, ct_reading, grid] {
    if (!grid->has_value()) *grid = read_ct(ct, ct_reading).grid;
    return **grid;
  };
  context.ct_frame_of_reference = [ct, ct_reading] {
    return ct_frame_of_reference(ct, ct_reading);
  };
  return context;
}

PoseContext pose_context(const Study& study,
                         const StudyCase& study_case,
                         const CtReadOptions& typed) {
  CameraRig rig{study.rig.isocenter_point, {}};
  for (const StudyView& view : study_case.views)
    rig.cameras.push_back(study.rig.camera(view.camera));
  return pose_context(
      study_case.ct, ct_reading_in_force(typed, study_case.ct_reading), rig, study_case.frame());
}

}  // namespace af
