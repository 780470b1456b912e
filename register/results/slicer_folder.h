// SPDX-License-Identifier: Apache-2.0
// A result as a folder that 3D Slicer loads.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "register/problem/registration_problem.h"
#include "study/study_file.h"

namespace af::registration {

/// Writes a result into `folder`, for 3D Slicer:
/// - ct-to-room.tfm (ITK transform, ct_from_room: applied to the CT, it shows the CT in the room);
/// - fiducials.mrk.json (when the case has any) and target-box.mrk.json (Slicer markups, ct frame,
///   LPS mm);
/// - per view xray-CAMERA.nrrd and drr-CAMERA.nrrd (whole detector, as attenuation, placed on the
///   detector in the room, LPS mm);
/// - README.md, which says where the CT is and how to load everything.
/// \test SlicerFiles.AreWhatItkAndJsonReadBack
void write_slicer_folder(const RegistrationProblem& problem,
                         const RigidTransform& room_from_ct,
                         const StudyCase& study_case,
                         const std::filesystem::path& folder);

/// The names of all files that it may write.
std::vector<std::string> slicer_file_names(const RegistrationProblem& problem);

/// Removes these files, and the folder when nothing else is in it. What somebody saved there stays.
/// \test SlicerFiles.AreRemovedButNothingElse
void remove_slicer_files(const RegistrationProblem& problem, const std::filesystem::path& folder);

}  // namespace af::registration
