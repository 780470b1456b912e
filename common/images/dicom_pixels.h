// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "images/dicom_elements.h"

namespace af {

/// How one DICOM file holds a grey frame, checked against the bytes that are there.
struct DicomPixelLayout {
  DicomElements header;
  int frame = 1;  ///< the one that is read, from 1
  int frames = 1;
  int columns = 0;
  int rows = 0;
  int allocated_bits = 16;
  int stored_bits = 16;
  int high_bit = 15;
  bool is_signed = false;
  /// Stored values that are not data, both ends included: PixelPaddingValue,
  /// PixelPaddingRangeLimit.
  std::optional<std::pair<std::int64_t, std::int64_t>> padding;
  double slope = 1.0;  ///< modality rescale; 1 and 0 when the file has none
  double intercept = 0.0;

  [[nodiscard]] const std::filesystem::path& path() const { return header.path(); }
  /// Lowest and highest value that a pixel can hold, rescaled. The first is the higher one when the
  /// slope is negative.
  [[nodiscard]] std::pair<double, double> value_range() const;
  /// "PixelPaddingValue 63536", or "... 0 to 10".
  [[nodiscard]] std::string padding_text() const;
};

/// Decoded pixels, row 0 on top.
struct DicomPixels {
  std::vector<double> values;  ///< rescaled; NaN where a pixel is padding
  std::size_t padded = 0;
  /// Pixels that hold the value of padding and are still read as data: where other pixels hold
  /// lower and higher values, only what reaches the picture's edge is padding.
  std::size_t doubtful = 0;
};

/// Throws InputError for more than one frame or channel, for colour and for a half-given rescale,
/// FileError for impossible bit depths or too few pixel bytes.
DicomPixelLayout dicom_pixel_layout(const DicomElements& header);

/// The same for one of several frames, from 1. Without `frame` there must be only one (InputError
/// names their count).
DicomPixelLayout dicom_frame_layout(const DicomElements& header, std::optional<int> frame);

/// Compressed pixels go through GDCM.
DicomPixels read_dicom_pixels(const DicomPixelLayout& layout);

}  // namespace af
