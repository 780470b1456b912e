// SPDX-License-Identifier: Apache-2.0
#include "image_files/dicom_xray.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "image_files/dicom_pixels.h"

namespace af {

namespace {

constexpr DicomTag kModality = {0x0008, 0x0060};
constexpr DicomTag kImagerPixelSpacing = {0x0018, 0x1164};
constexpr DicomTag kPhotometric = {0x0028, 0x0004};
constexpr DicomTag kPixelSpacing = {0x0028, 0x0030};
constexpr DicomTag kRelationship = {0x0028, 0x1040};
constexpr DicomTag kSign = {0x0028, 0x1041};
constexpr DicomTag kWindowCenter = {0x0028, 0x1050};
constexpr DicomTag kWindowWidth = {0x0028, 0x1051};
constexpr DicomTag kModalityLut = {0x0028, 0x3000};

/// Column, row, from DICOM's "row\column".
std::optional<Eigen::Vector2d> spacing_of(const DicomElements& header,
                                          DicomTag tag,
                                          const char* name) {
  const std::vector<double> values = header.numbers(tag, name);
  if (values.empty()) return std::nullopt;
  if (values.size() != 2 || !(values[0] > 0.0 && values[1] > 0.0))
    throw InputError(name,
                     "'" + header.text(tag) + "'",
                     "must be two positive numbers (mm)",
                     header.path().string());
  return Eigen::Vector2d(values[1], values[0]);
}

PixelIntensity relationship_of(const std::string& text) {
  if (text.empty()) return PixelIntensity::NotStated;
  if (text == "LIN") return PixelIntensity::Linear;
  if (text == "LOG") return PixelIntensity::Logarithmic;
  return text == "DISP" ? PixelIntensity::Display : PixelIntensity::Other;
}

std::optional<int> sign_of(const DicomElements& header) {
  const auto sign = header.number_or_none(kSign, "PixelIntensityRelationshipSign");
  if (!sign) return std::nullopt;
  if (*sign != 1.0 && *sign != -1.0)
    throw InputError("PixelIntensityRelationshipSign",
                     "'" + header.text(kSign) + "'",
                     "must be 1 or -1",
                     header.path().string());
  return static_cast<int>(*sign);
}

Image2d image_of(const DicomPixelLayout& layout) {
  const std::vector<double> values = read_dicom_pixels(layout);
  Image2d image(layout.columns, layout.rows);
  std::transform(values.begin(), values.end(), image.pixels.begin(), [](const double value) {
    return static_cast<float>(value);
  });
  const auto bad = std::find_if_not(
      image.pixels.begin(), image.pixels.end(), [](float value) { return std::isfinite(value); });
  if (bad != image.pixels.end())
    throw InputError("RescaleSlope, RescaleIntercept",
                     "'" + layout.header.text({0x0028, 0x1053}) + "', '" +
                         layout.header.text({0x0028, 0x1052}) + "'",
                     "must give finite values",
                     layout.path().string());
  return image;
}

}  // namespace

DicomXray read_dicom_xray(const std::filesystem::path& path, std::optional<int> frame) {
  const DicomElements header = DicomElements::read(path);
  const DicomPixelLayout layout = dicom_frame_layout(header, frame);
  DicomXray xray;
  xray.modality = header.text(kModality);
  xray.frame = layout.frame;
  xray.frames = layout.frames;
  xray.stored_bits = layout.stored_bits;
  xray.is_monochrome1 = header.text(kPhotometric) == "MONOCHROME1";
  xray.is_rescaled = layout.slope != 1.0 || layout.intercept != 0.0;
  xray.relationship_text = header.text(kRelationship);
  xray.relationship = relationship_of(xray.relationship_text);
  xray.sign = sign_of(header);
  if (const std::string center = header.text(kWindowCenter); !center.empty())
    xray.window = center + "/" + header.text(kWindowWidth);
  xray.has_modality_lut = header.has(kModalityLut);
  const auto [low, high] = layout.value_range();
  xray.inversion_sum = low + high;
  xray.imager_spacing_mm = spacing_of(header, kImagerPixelSpacing, "ImagerPixelSpacing");
  xray.pixel_spacing_mm = spacing_of(header, kPixelSpacing, "PixelSpacing");
  xray.image = image_of(layout);
  return xray;
}

}  // namespace af
