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

/// The X-rays of one view, each prepared as the view's XrayReading says: that of the study, and
/// others of the same camera. Mask, flat and dark fields are read with the first. For one thread at
/// a time; copies share what was read.
class ViewXrayReader {
 public:
  ViewXrayReader(StudyView view, CameraGeometry camera);

  [[nodiscard]] const StudyView& view() const { return view_; }
  /// As read_view_xray().
  [[nodiscard]] ViewXray read();
  /// As if the view's file were one without a header and held these values. Errors as of read().
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

/// Reads a view's X-ray in the attenuation domain, as its XrayReading says. Intensities are turned
/// by -log(I / I_open); I_open is the 99.9th percentile of the image unless the view says
/// otherwise. MONOCHROME1, rescale and PixelIntensityRelationship of DICOM are honoured, windows
/// are not. Images of a camera with distortion are undistorted behind flat and dark fields and
/// before the logarithm; so are masks. Padding of DICOM is masked. InputError when the size or the
/// pixel spacing is not the camera's, the image is constant, the air level cannot be found, an
/// automatic mask hides most of the region, or the values are logarithms and called intensities.
ViewXray read_view_xray(const StudyView& view, const CameraGeometry& camera);

}  // namespace af
