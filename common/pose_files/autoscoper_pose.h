// SPDX-License-Identifier: Apache-2.0
// Autoscoper's tracking files (.tra): one line per frame of the X-ray films with the 16 numbers of
// room_from_volume, row by row, mm, or 16 times NaN where a frame was not tracked.
#pragma once

#include "pose_files/pose_format.h"

namespace af {

/// ct from Autoscoper's volume frame. Of voxel (i, j, k) of nx x ny x nz, the centre lies at
/// x = (i + 0.5) sx, y = (ny - j - 0.5) sy, z = -(k + 0.5) sz: the origin is the corner of the
/// stack's first picture at the lower left, y points up that picture, and the stack grows along -z
/// (Autoscoper's ray caster and VolumeDescription, without VolumeFlip). InputError when the CT's
/// axes are left-handed: no rigid map leads there.
RigidTransform ct_from_autoscoper_volume(const CtGrid& grid);

bool is_autoscoper(const PoseFileBytes& file);
PosesInFile read_autoscoper(const PoseFileBytes& file, const PoseContext& context);
std::string write_autoscoper(std::span<const RigidTransform> room_from_ct,
                             const PoseContext& context);

}  // namespace af
