// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "image_files/dicom_elements.h"

namespace af {

/// How one DICOM file holds its single grey frame; checked against the bytes that are there.
struct DicomPixelLayout {
  DicomElements header;
  int columns = 0;
  int rows = 0;
  int allocated_bits = 16;
  int stored_bits = 16;
  int high_bit = 15;
  bool is_signed = false;
  double slope = 1.0;  ///< modality rescale; 1 and 0 when the file has none
  double intercept = 0.0;

  [[nodiscard]] const std::filesystem::path& path() const { return header.path(); }
};

/// InputError for more than one frame or channel, for colour and a half-given rescale; FileError
/// for impossible bit depths or too few pixel bytes.
DicomPixelLayout dicom_pixel_layout(const DicomElements& header);

/// Decoded pixels with the rescale applied, row 0 on top. Compressed ones go through GDCM.
std::vector<double> read_dicom_pixels(const DicomPixelLayout& layout);

}  // namespace af
