// SPDX-License-Identifier: Apache-2.0
#include "image_files/dicom_pixels.h"

#include <cstring>
#include <gdcmImageReader.h>
#include <gdcmTrace.h>
#include <new>
#include <string>

#include "base/error.h"
#include "files/input_file.h"

namespace af {

namespace {

constexpr double kMaxSidePx = 65535.0;

void silence_gdcm() {
  static const bool done = [] {
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    gdcm::Trace::DebugOff();
    return true;
  }();
  (void)done;
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

void read_bit_layout(const DicomElements& header, DicomPixelLayout& layout) {
  layout.allocated_bits = required_integer(header, {0x0028, 0x0100}, "BitsAllocated", 8, 32);
  if (layout.allocated_bits % 8 != 0 || layout.allocated_bits == 24)
    throw FileError(header.path().string(),
                    "BitsAllocated",
                    "8, 16 or 32",
                    std::to_string(layout.allocated_bits));
  layout.stored_bits =
      required_integer(header, {0x0028, 0x0101}, "BitsStored", 1, layout.allocated_bits);
  layout.high_bit = required_integer(
      header, {0x0028, 0x0102}, "HighBit", layout.stored_bits - 1, layout.allocated_bits - 1);
  layout.is_signed = required_integer(header, {0x0028, 0x0103}, "PixelRepresentation", 0, 1) == 1;
}

std::size_t pixel_count(const DicomPixelLayout& layout) {
  return static_cast<std::size_t>(layout.columns) * static_cast<std::size_t>(layout.rows);
}

std::size_t decoded_bytes(const DicomPixelLayout& layout) {
  return pixel_count(layout) * static_cast<std::size_t>(layout.allocated_bits) / 8;
}

void check_bytes(const DicomElements& header, const DicomPixelLayout& layout) {
  const std::string file = layout.path().string();
  const std::uint64_t expected = decoded_bytes(layout);
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

std::vector<char> part_of_file(const std::filesystem::path& path, const DicomPart& part) {
  std::ifstream file = open_input_file(path);
  file.seekg(static_cast<std::streamoff>(part.offset));
  std::vector<char> bytes(part.bytes);
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file) throw FileError(path.string(), "its pixels cannot be read");
  return bytes;
}

/// GDCM's image of what the file says, made without its parser.
gdcm::Image compressed_image(const DicomPixelLayout& layout) {
  const std::string syntax = layout.header.text({0x0002, 0x0010});
  const gdcm::TransferSyntax::TSType type = gdcm::TransferSyntax::GetTSType(syntax.c_str());
  if (type == gdcm::TransferSyntax::TS_END)
    throw InputError(
        "transfer syntax", syntax, "is not known to the decoder", layout.path().string());
  const gdcm::SmartPointer<gdcm::SequenceOfFragments> fragments = new gdcm::SequenceOfFragments;
  const std::vector<DicomPart>& parts = layout.header.pixel_parts();
  for (std::size_t i = 1; i < parts.size(); ++i) {
    const std::vector<char> bytes = part_of_file(layout.path(), parts[i]);
    gdcm::Fragment fragment;
    fragment.SetByteValue(bytes.data(), parts[i].bytes);
    fragments->AddFragment(fragment);
  }
  gdcm::DataElement pixels(gdcm::Tag(0x7fe0, 0x0010));
  pixels.SetVR(gdcm::VR::OB);
  pixels.SetValue(*fragments);
  gdcm::Image image;
  image.SetNumberOfDimensions(2);
  image.SetColumns(static_cast<unsigned>(layout.columns));
  image.SetRows(static_cast<unsigned>(layout.rows));
  image.SetTransferSyntax(type);
  image.SetPixelFormat(gdcm::PixelFormat(1,
                                         static_cast<std::uint16_t>(layout.allocated_bits),
                                         static_cast<std::uint16_t>(layout.stored_bits),
                                         static_cast<std::uint16_t>(layout.high_bit),
                                         layout.is_signed ? 1 : 0));
  image.SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
  image.SetDataElement(pixels);
  return image;
}

std::vector<char> decompressed(const DicomPixelLayout& layout) {
  const std::string file = layout.path().string();
  silence_gdcm();
  try {
    const gdcm::Image image = compressed_image(layout);
    std::vector<char> bytes(decoded_bytes(layout));
    if (image.GetBufferLength() != bytes.size())
      throw FileError(file,
                      "decoded pixels",
                      std::to_string(bytes.size()) + " bytes",
                      std::to_string(image.GetBufferLength()));
    if (!image.GetBuffer(bytes.data())) throw FileError(file, "its compressed pixels are corrupt");
    return bytes;
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (...) {  // GDCM also throws what is no exception class
    throw FileError(file, "its compressed pixels cannot be decoded");
  }
}

/// Cuts the stored bits out of the allocated ones, extends the sign, and rescales.
std::vector<double> rescaled(const std::vector<char>& raw,
                             bool is_big_endian,
                             const DicomPixelLayout& layout) {
  const auto pixel_bytes = static_cast<std::size_t>(layout.allocated_bits) / 8;
  const int shift = layout.high_bit + 1 - layout.stored_bits;
  const std::int64_t range = std::int64_t{1} << layout.stored_bits;
  std::vector<double> values(pixel_count(layout));
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::uint32_t bits = 0;
    for (std::size_t byte = 0; byte < pixel_bytes; ++byte) {
      const std::size_t at = is_big_endian ? byte : pixel_bytes - 1 - byte;
      bits = bits << 8 | static_cast<unsigned char>(raw[i * pixel_bytes + at]);
    }
    std::int64_t value = std::int64_t{bits >> shift} & (range - 1);
    if (layout.is_signed && value >= range / 2) value -= range;
    values[i] = static_cast<double>(value) * layout.slope + layout.intercept;
  }
  return values;
}

}  // namespace

DicomPixelLayout dicom_pixel_layout(const DicomElements& header) {
  check_is_one_grey_frame(header);
  DicomPixelLayout layout;
  layout.header = header;
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
  read_bit_layout(header, layout);
  check_bytes(header, layout);
  return layout;
}

std::vector<double> read_dicom_pixels(const DicomPixelLayout& layout) {
  if (layout.header.has_compressed_pixels()) return rescaled(decompressed(layout), false, layout);
  return rescaled(part_of_file(layout.path(), layout.header.pixel_parts().front()),
                  layout.header.is_big_endian(),
                  layout);
}

}  // namespace af
