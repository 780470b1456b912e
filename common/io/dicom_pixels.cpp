// SPDX-License-Identifier: Apache-2.0
#include "io/dicom_pixels.h"

#include <cstring>
#include <gdcmImageReader.h>
#include <gdcmTrace.h>
#include <new>
#include <string>

#include "base/error.h"

namespace af {

namespace {

constexpr double kMaxSidePx = 65535.0;

void silence_gdcm() {
  static const bool kDone = [] {
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    gdcm::Trace::DebugOff();
    return true;
  }();
  (void)kDone;
}

int required_integer(
    const DicomElements& header, DicomTag tag, const char* name, double low, double high) {
  const auto value = header.number_or_none(tag, name);
  if (!value || !(*value >= low && *value <= high))
    throw FileError(
        header.path().string(),
        name,
        std::to_string(static_cast<int>(low)) + " to " + std::to_string(static_cast<int>(high)),
        value ? header.text(tag) : "nothing");
  return static_cast<int>(*value);
}

void check_is_one_grey_frame(const DicomElements& header) {
  const std::string file = header.path().string();
  const auto frames = header.number_or_none({0x0028, 0x0008}, "NumberOfFrames");
  if (frames.value_or(1.0) != 1.0)
    throw InputError("NumberOfFrames",
                     header.text({0x0028, 0x0008}),
                     "multi-frame files (enhanced CT) are not supported; convert to NIfTI, for "
                     "example with dcm2niix",
                     file);
  if (header.number_or_none({0x0028, 0x0002}, "SamplesPerPixel").value_or(1.0) != 1.0)
    throw InputError(
        "SamplesPerPixel", header.text({0x0028, 0x0002}), "must be 1, one value per pixel", file);
  if (const std::string meaning = header.text({0x0028, 0x0004}); !meaning.starts_with("MONOCHROME"))
    throw InputError("PhotometricInterpretation", "'" + meaning + "'", "must be grey", file);
  if (!header.has_pixels()) throw FileError(file, "has no pixel data");
}

/// Bytes of one stored pixel.
std::uint64_t stored_pixel_bytes(const DicomElements& header) {
  const int allocated = required_integer(header, {0x0028, 0x0100}, "BitsAllocated", 8, 32);
  if (allocated % 8 != 0 || allocated == 24)
    throw FileError(
        header.path().string(), "BitsAllocated", "8, 16 or 32", std::to_string(allocated));
  const int stored = required_integer(header, {0x0028, 0x0101}, "BitsStored", 1, allocated);
  (void)required_integer(header, {0x0028, 0x0102}, "HighBit", stored - 1, allocated - 1);
  (void)required_integer(header, {0x0028, 0x0103}, "PixelRepresentation", 0, 1);
  return static_cast<std::uint64_t>(allocated) / 8;
}

void check_bytes(const DicomElements& header, const DicomPixelLayout& layout) {
  const std::string file = layout.path.string();
  const std::uint64_t expected = static_cast<std::uint64_t>(layout.columns) *
                                 static_cast<std::uint64_t>(layout.rows) *
                                 stored_pixel_bytes(header);
  if (!header.has_compressed_pixels() && header.pixel_bytes() < expected)
    throw FileError(file,
                    "pixel data",
                    std::to_string(expected) + " bytes",
                    std::to_string(header.pixel_bytes()));
  // No lossless codec packs an image with noise this tightly; a header that says so lies.
  constexpr std::uint64_t kMaxCompression = 1000;
  if (expected / kMaxCompression > header.pixel_bytes())
    throw FileError(file,
                    "compressed pixel data",
                    "at least " + std::to_string(expected / kMaxCompression) + " bytes",
                    std::to_string(header.pixel_bytes()));
}

template <typename T>
std::vector<double> rescaled(const std::vector<char>& raw, const DicomPixelLayout& layout) {
  std::vector<double> values(raw.size() / sizeof(T));
  for (std::size_t i = 0; i < values.size(); ++i) {
    T value{};
    std::memcpy(&value, raw.data() + i * sizeof(T), sizeof(T));
    values[i] = static_cast<double>(value) * layout.slope + layout.intercept;
  }
  return values;
}

struct DecodedPixels {
  std::vector<char> bytes;
  gdcm::PixelFormat format;
};

DecodedPixels decode(const DicomPixelLayout& layout) {
  const std::string file = layout.path.string();
  silence_gdcm();
  try {
    gdcm::ImageReader reader;
    reader.SetFileName(layout.path.c_str());
    if (!reader.Read()) throw FileError(file, "its pixels are corrupt or of an unknown encoding");
    const gdcm::Image& image = reader.GetImage();
    DecodedPixels pixels;
    pixels.format = image.GetPixelFormat();
    const std::size_t expected = static_cast<std::size_t>(layout.columns) *
                                 static_cast<std::size_t>(layout.rows) *
                                 pixels.format.GetPixelSize();
    if (image.GetBufferLength() != expected)
      throw FileError(file,
                      "decoded pixels",
                      std::to_string(expected) + " bytes",
                      std::to_string(image.GetBufferLength()));
    pixels.bytes.resize(expected);
    if (!image.GetBuffer(pixels.bytes.data()))
      throw FileError(file, "its pixels are truncated or corrupt");
    return pixels;
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (...) {  // GDCM also throws what is no exception class
    throw FileError(file, "its pixels cannot be decoded");
  }
}

}  // namespace

DicomPixelLayout dicom_pixel_layout(const DicomElements& header) {
  check_is_one_grey_frame(header);
  DicomPixelLayout layout;
  layout.path = header.path();
  layout.rows = required_integer(header, {0x0028, 0x0010}, "Rows", 1, kMaxSidePx);
  layout.columns = required_integer(header, {0x0028, 0x0011}, "Columns", 1, kMaxSidePx);
  const auto slope = header.number_or_none({0x0028, 0x1053}, "RescaleSlope");
  const auto intercept = header.number_or_none({0x0028, 0x1052}, "RescaleIntercept");
  if (slope.has_value() != intercept.has_value() || slope.value_or(1.0) == 0.0)
    throw InputError(
        "RescaleSlope, RescaleIntercept",
        "'" + header.text({0x0028, 0x1053}) + "', '" + header.text({0x0028, 0x1052}) + "'",
        "both are needed, the slope not 0",
        header.path().string());
  layout.slope = slope.value_or(1.0);
  layout.intercept = intercept.value_or(0.0);
  check_bytes(header, layout);
  return layout;
}

std::vector<double> read_dicom_pixels(const DicomPixelLayout& layout) {
  const DecodedPixels pixels = decode(layout);
  switch (pixels.format.GetScalarType()) {
    case gdcm::PixelFormat::UINT8:
      return rescaled<std::uint8_t>(pixels.bytes, layout);
    case gdcm::PixelFormat::INT8:
      return rescaled<std::int8_t>(pixels.bytes, layout);
    case gdcm::PixelFormat::UINT12:
    case gdcm::PixelFormat::UINT16:
      return rescaled<std::uint16_t>(pixels.bytes, layout);
    case gdcm::PixelFormat::INT12:
    case gdcm::PixelFormat::INT16:
      return rescaled<std::int16_t>(pixels.bytes, layout);
    case gdcm::PixelFormat::UINT32:
      return rescaled<std::uint32_t>(pixels.bytes, layout);
    case gdcm::PixelFormat::INT32:
      return rescaled<std::int32_t>(pixels.bytes, layout);
    default:
      throw InputError("pixel type",
                       pixels.format.GetScalarTypeAsString(),
                       "must be an integer of 8, 16 or 32 bits",
                       layout.path.string());
  }
}

}  // namespace af
