// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "images/dicom_elements.h"
#include "xray/image2d.h"

namespace af {

/// DICOM's PixelIntensityRelationship: values proportional to intensity, to its logarithm, or made
/// for display.
enum class PixelIntensity { NotStated, Linear, Logarithmic, Display, Other };

/// One frame of a DICOM X-ray (XA, RF, CR, DX, ...) and what the file says of its values.
struct DicomXray {
  DicomElements header;
  Image2d image;  ///< rescaled; neither inverted nor windowed; row 0 on top
  Image2d
      data;  ///< 0 where a pixel is padding (PixelPaddingValue), 1 elsewhere; empty without padding
  std::string padding;   ///< what padding is, for messages
  std::string modality;  ///< empty when the file does not state it
  int frame = 1;
  int frames = 1;
  int stored_bits = 16;
  bool is_monochrome1 = false;  ///< shown with low values white
  bool is_rescaled = false;     ///< by a slope other than 1 or an intercept other than 0
  PixelIntensity relationship = PixelIntensity::NotStated;
  std::string relationship_text;  ///< as the file has it
  /// PixelIntensityRelationshipSign: 1 = higher values mean more intensity, -1 = less.
  std::optional<int> sign;
  std::string window;  ///< "centre/width" as the file has it; empty: none
  /// "kind, N entries" of the Modality LUT that replaced slope and intercept.
  std::string modality_lut;
  /// The LUT of an XA or RF image turned logarithms into values linear in intensity (PS3.3,
  /// C.8.7.1.1.2). `relationship` is then Linear.
  bool was_linearised = false;
  /// What the frame says of it (Pixel Intensity Relationship LUT), when it has functional groups.
  std::string intensity_function;
  /// Sum of the lowest and highest value that a pixel can hold. Subtracting a value from it turns
  /// white into black.
  double inversion_sum = 0.0;
};

/// Reads frame `frame` (from 1) of a DICOM image file. Without `frame` there must be only one.
/// Errors are those of read_image(). Throws InputError also for a PixelIntensityRelationshipSign
/// that is not 1 or -1, for a Modality LUT that is broken or stands beside a rescale, and for a
/// picture that is nothing but padding. Pixel spacings are left to imager_spacing_mm() and
/// xray_pixel_spacing_mm().
DicomXray read_dicom_xray(const std::filesystem::path& path, std::optional<int> frame);

/// Column, row of PixelSpacing, which may describe a plane in the patient. Throws InputError when
/// it is not two positive numbers.
std::optional<Eigen::Vector2d> xray_pixel_spacing_mm(const DicomXray& xray);

}  // namespace af
