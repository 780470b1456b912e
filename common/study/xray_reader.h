// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
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

/// The X-rays of one view, each prepared as the view's XrayReading says: the study's own, and
/// others of the same camera. Mask, flat and dark fields are read with the first. For one thread at
/// a time. Copies share what was read.
class ViewXrayReader {
 public:
  ViewXrayReader(StudyView view, CameraGeometry camera);

  [[nodiscard]] const StudyView& view() const { return view_; }
  /// Like read_view_xray().
  [[nodiscard]] ViewXray read();
  /// As if the view's file had no header and held these values. Throws as read() does.
  /// \test XrayReader.PreparesValuesAsTheFileThatHoldsThem
  [[nodiscard]] ViewXray prepared(Image2d values);

 private:
  template <typename Load>
  ViewXray prepared(const StudyView& view, const Load& load_xray);

  struct Kept;
  StudyView view_;
  CameraGeometry camera_;
  std::shared_ptr<Kept> kept_;
};

/// Reads a view's X-ray in the attenuation domain, as its XrayReading says. Intensities become
/// -log(I / I_open), where I_open is the 99.9th percentile of the image unless the view says
/// otherwise. DICOM's MONOCHROME1, rescale and PixelIntensityRelationship are honoured; windows are
/// not. For a camera with distortion, images are undistorted after flat and dark fields and before
/// the logarithm, and so are masks. DICOM's padding is masked.
/// Throws InputError when the size or the pixel spacing is not the camera's, the image is constant,
/// the air level cannot be found, an automatic mask hides most of the region, or the values are
/// logarithms declared as intensities.
ViewXray read_view_xray(const StudyView& view, const CameraGeometry& camera);

}  // namespace af
