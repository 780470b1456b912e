// SPDX-License-Identifier: Apache-2.0
// Tests whether a case's target can be seen at all, before anything is rendered or registered.
#pragma once

#include <string>

#include "ct/ct_volume.h"
#include "study/study_file.h"

namespace af {

/// The axis-aligned box in the ct frame (mm) that holds all voxels including their outer halves.
CtBox bounding_box(const CtGrid& grid);

/// Why the target box cannot be seen at the case's nominal pose: all of it lies behind the source
/// or beside the detector. Empty when some of it is in the beam.
std::string beam_problem(const StudyCase& study_case, const CameraGeometry& camera);

/// Throws InputError, with the study's line, when the target box and the CT have no point in
/// common.
/// \test StudyFile.ATargetBoxOutsideTheCtIsRefused
void require_target_in_ct(const StudyCase& study_case, const CtGrid& ct);

}  // namespace af
