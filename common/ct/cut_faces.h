// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "ct/attenuation_volume.h"

namespace af {

/// Where the CT ends but the body goes on. `box` is the CT's attenuating_box(). Returns the centres
/// (ct frame, mm) of the attenuating voxels of those outermost layers that are cuts, at most a few
/// thousand.
/// An outermost layer (of the attenuating part) is a cut when it attenuates over more than half as
/// much area as the layer 2 mm further in. A shaft that the scan or a segmentation cut through does
/// so. A rounded end that the CT is cropped to does not. \test
/// CutFaces.AreWhereAShaftIsCutAndNotWhereABodyEnds
std::vector<Eigen::Vector3d> cut_points(const CtVolume& ct,
                                        const AttenuationModel& model,
                                        const AttenuatingBox& box);

}  // namespace af
