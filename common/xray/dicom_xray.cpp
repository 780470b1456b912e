// SPDX-License-Identifier: Apache-2.0
#include "xray/dicom_xray.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "images/dicom_pixels.h"

namespace af {

namespace {

constexpr DicomTag kModality = {0x0008, 0x0060};
constexpr DicomTag kPhotometric = {0x0028, 0x0004};
constexpr DicomTag kPixelSpacing = {0x0028, 0x0030};
constexpr DicomTag kRelationship = {0x0028, 0x1040};
constexpr DicomTag kSign = {0x0028, 0x1041};
constexpr DicomTag kWindowCenter = {0x0028, 0x1050};
constexpr DicomTag kWindowWidth = {0x0028, 0x1051};
constexpr DicomTag kModalityLut = {0x0028, 0x3000};
constexpr DicomTag kIntensityLuts = {0x0028, 0x9422};
constexpr DicomTag kLutFunction = {0x0028, 0x9474};

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

/// Maps stored values to others (PS3.3, C.11.1). Outside of its range its end values hold.
struct ModalityLut {
  double first = 0.0;  ///< the stored value of the first entry
  std::vector<double> entries;
  double highest = 0.0;  ///< highest value that its bits can hold
  std::string kind;

  [[nodiscard]] double operator()(double stored) const {
    const double last = static_cast<double>(entries.size()) - 1.0;
    return entries[static_cast<std::size_t>(std::clamp(stored - first, 0.0, last))];
  }
};

ModalityLut modality_lut_of(const DicomPixelLayout& layout) {
  const std::string file = layout.path().string();
  const DicomValues& item = layout.header.values().item(kModalityLut);
  const std::vector<double> descriptor =
      item.numbers({0x0028, 0x3002}, "LUTDescriptor (0028,3002)", file);
  constexpr double kMostEntries = 65536.0;
  constexpr double kMostBits = 16.0;
  if (descriptor.size() != 3 || !(descriptor[2] >= 1.0 && descriptor[2] <= kMostBits))
    throw FileError(file, "LUTDescriptor (0028,3002) is no count, first value and 1 to 16 bits");
  ModalityLut lut;
  lut.kind = item.text({0x0028, 0x3004});
  lut.highest = std::exp2(descriptor[2]) - 1.0;
  // Counts have no sign, however the file stores them. First values have that of the pixels.
  const auto wrapped = [&](double value) { return value < 0.0 ? value + kMostEntries : value; };
  const double count = descriptor[0] == 0.0 ? kMostEntries : wrapped(descriptor[0]);
  lut.first = layout.is_signed && descriptor[1] >= kMostEntries / 2.0 ? descriptor[1] - kMostEntries
                                                                      : descriptor[1];
  lut.entries = item.numbers({0x0028, 0x3006}, "LUTData (0028,3006)", file);
  std::transform(lut.entries.begin(), lut.entries.end(), lut.entries.begin(), wrapped);
  if (static_cast<double>(lut.entries.size()) != count)
    throw FileError(file,
                    "LUTData (0028,3006)",
                    std::to_string(static_cast<int>(count)) + " entries",
                    std::to_string(lut.entries.size()));
  if (layout.slope != 1.0 || layout.intercept != 0.0)
    throw InputError(file + ": a Modality LUT and RescaleSlope contradict each other");
  return lut;
}

/// Adds what the LUT changes to what the file says of its values.
void apply_modality_lut(const DicomPixelLayout& layout, DicomXray& xray) {
  const ModalityLut lut = modality_lut_of(layout);
  for (float& value : xray.image.pixels)
    value = static_cast<float>(lut(static_cast<double>(value)));
  xray.modality_lut = (lut.kind.empty() ? std::string() : lut.kind + ", ") +
                      std::to_string(lut.entries.size()) + " entries";
  xray.inversion_sum = lut.highest;
  const bool is_angiography = xray.modality == "XA" || xray.modality == "RF";
  if (is_angiography && xray.relationship == PixelIntensity::Logarithmic) {
    xray.was_linearised = true;
    xray.relationship = PixelIntensity::Linear;
    xray.sign = 1;
  }
}

void read_pixels(const DicomPixelLayout& layout, DicomXray& xray) {
  const DicomPixels pixels = read_dicom_pixels(layout);
  const std::string file = layout.path().string();
  if (pixels.padded == pixels.values.size())
    throw InputError("pixels", "all of " + layout.padding_text(), "nothing but padding", file);
  xray.image = Image2d(layout.columns, layout.rows);
  std::transform(pixels.values.begin(),
                 pixels.values.end(),
                 xray.image.pixels.begin(),
                 [](const double value) { return static_cast<float>(value); });
  if (pixels.padded > 0) {
    xray.padding = layout.padding_text();
    xray.data = Image2d(layout.columns, layout.rows);
    const auto first = std::find_if_not(
        pixels.values.begin(), pixels.values.end(), [](double v) { return std::isnan(v); });
    for (std::size_t i = 0; i < pixels.values.size(); ++i) {
      const bool is_data = !std::isnan(pixels.values[i]);
      xray.data.pixels[i] = is_data ? 1.0f : 0.0f;
      if (!is_data) xray.image.pixels[i] = static_cast<float>(*first);
    }
  }
  const auto bad = std::find_if_not(xray.image.pixels.begin(),
                                    xray.image.pixels.end(),
                                    [](float value) { return std::isfinite(value); });
  if (bad != xray.image.pixels.end())
    throw InputError("RescaleSlope, RescaleIntercept",
                     "'" + layout.header.text({0x0028, 0x1053}) + "', '" +
                         layout.header.text({0x0028, 0x1052}) + "'",
                     "must give finite values",
                     file);
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
  const auto [low, high] = layout.value_range();
  xray.inversion_sum = low + high;
  if (const DicomValues* const luts = functional_group(header, xray.frame, kIntensityLuts);
      luts != nullptr)
    xray.intensity_function = luts->text(kLutFunction);
  read_pixels(layout, xray);
  if (header.has(kModalityLut)) apply_modality_lut(layout, xray);
  xray.header = header;
  return xray;
}

std::optional<Eigen::Vector2d> xray_pixel_spacing_mm(const DicomXray& xray) {
  return dicom_spacing_mm(
      xray.header.values(), kPixelSpacing, "PixelSpacing", xray.header.path().string());
}

}  // namespace af
