// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "study/study_file.h"

namespace af {

/// Reads a view's X-ray in the attenuation domain (bright = attenuated): intensities are turned by
/// -log(I / I_open), I_open being the 99.9th percentile of the image, zeros counting as half a
/// level. InputError when its size is not the camera's or it is constant.
Image2d read_xray_attenuation(const StudyView& view, const CameraGeometry& camera);

/// Optional mask (non-zero = used), the camera's size; empty image when the view has none.
Image2d read_mask(const StudyView& view, const CameraGeometry& camera);

}  // namespace af
