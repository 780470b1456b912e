// SPDX-License-Identifier: Apache-2.0
// DICOM Spatial Registration objects (PS3.3, A.39 and C.20.2): for each frame of reference, the
// matrix that takes its points to the registered one, here the room's; mm.
#pragma once

#include "pose_files/pose_format.h"

namespace af {

bool is_dicom_registration(const PoseFileBytes& file);
/// Whether a file is one of that kind by its UID; other DICOM files are not.
bool holds_dicom_registration(const PoseFileBytes& file);

/// Room is the object's own frame of reference (0020,0052), or that of its item whose matrix stands
/// for it. The CT's item is the one with the CT's UID where that is known, else the only one of
/// another frame of reference; InputError that lists them when there are several, and when the
/// room's is itself the CT's, which no item then matches.
PosesInFile read_dicom_registration(const PoseFileBytes& file, const PoseContext& context);

/// Two items: the room's, the identity, and the CT's, room_from_ct. UIDs that are not known are
/// made of the pose (2.25.*): the same pose gives the same file.
std::string write_dicom_registration(std::span<const RigidTransform> room_from_ct,
                                     const PoseContext& context);

}  // namespace af
