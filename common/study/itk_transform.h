// SPDX-License-Identifier: Apache-2.0
// ITK transforms as text. A pose is the resampling direction, ct_from_room in LPS mm: Slicer,
// applying it to the CT, shows the CT in the room. Affine, rigid, versor, quaternion, Euler and
// translation transforms in three dimensions can be read.
#pragma once

#include "study/pose_format.h"

namespace af {

bool is_itk_text(const PoseFileBytes& file);
PosesInFile read_itk_text(const PoseFileBytes& file, const PoseContext& context);

}  // namespace af
