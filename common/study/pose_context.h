// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "image_files/ct_reader.h"
#include "pose_files/pose_format.h"
#include "study/study_file.h"

namespace af {

/// What formats of poses may ask: the CT is read only when one does. An empty CT or rig is one
/// that is not known.
PoseContext pose_context(const std::filesystem::path& ct,
                         const CtReadOptions& ct_reading,
                         const std::optional<CameraRig>& rig,
                         const std::optional<PoseFrame>& frame);

/// That of a case: its CT, read as the command line says (`typed`) where it differs from the study,
/// the cameras of its views, its nominal pose. InputError as of ct_reading_in_force().
PoseContext pose_context(const Study& study,
                         const StudyCase& study_case,
                         const CtReadOptions& typed = {});

}  // namespace af
