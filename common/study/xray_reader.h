// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "study/study_file.h"

namespace af {

/// A view's X-ray as registration compares it.
struct ViewXray {
  Image2d attenuation;  ///< bright = attenuated; line integrals as far as the X-ray gives them
  Image2d mask;         ///< the camera's size, non-zero = used; empty: every pixel
  std::string note;     ///< what was done to the values: frame, inversion, air level, mask
  std::vector<std::string> warnings;
};

/// Reads a view's X-ray in the attenuation domain, as its XrayReading says. Intensities are turned
/// by -log(I / I_open); I_open is the 99.9th percentile of the image unless the view says
/// otherwise. MONOCHROME1, rescale and PixelIntensityRelationship of DICOM are honoured, windows
/// are not. Images of a camera with distortion are undistorted behind flat and dark fields and
/// before the logarithm; so are masks. Padding of DICOM is masked. InputError when the size or the
/// pixel spacing is not the camera's, the image is constant, the air level cannot be found, an
/// automatic mask hides most of the region, or the values are logarithms and called intensities.
ViewXray read_view_xray(const StudyView& view, const CameraGeometry& camera);

}  // namespace af
