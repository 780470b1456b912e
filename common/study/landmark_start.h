// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "geometry/landmark_pose.h"
#include "study/study_file.h"

namespace af {

/// Whether a case states landmarks and any view shows one.
bool has_landmarks(const StudyCase& study_case);

/// The pose that a case's landmarks give. The nominal pose decides where several fit
/// (pose_from_landmarks()). Throws InputError that names the case when it has none, or too few.
LandmarkPose landmark_pose(const Study& study, const StudyCase& study_case);
/// The same for a case of any study with this rig.
LandmarkPose landmark_pose(const CameraRig& rig, const StudyCase& study_case);

/// How far each landmark is from where each view saw it, in px and mm, and the notes, as lines of
/// text and as JSON.
std::string residuals_text(const LandmarkPose& pose, const StudyCase& study_case);
nlohmann::json to_json(const LandmarkPose& pose, const StudyCase& study_case);

}  // namespace af
