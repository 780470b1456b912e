// SPDX-License-Identifier: Apache-2.0
#include "images/dicom_pixels.h"

#include <algorithm>
#include <cstring>
#include <gdcmImageReader.h>
#include <gdcmTrace.h>
#include <limits>
#include <span>
#include <string>
#include <utility>

#include "base/contained_work.h"
#include "base/error.h"
#include "files/input_file.h"

namespace af {

namespace {

constexpr double kMaxSidePx = 65535.0;
constexpr double kMaxFrames = 100000.0;
constexpr DicomTag kPaddingValue = {0x0028, 0x0120};
constexpr DicomTag kPaddingLimit = {0x0028, 0x0121};

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

void check_is_one_frame(const DicomElements& header) {
  if (header.number_or_none({0x0028, 0x0008}, "NumberOfFrames").value_or(1.0) != 1.0)
    throw InputError("NumberOfFrames",
                     header.text({0x0028, 0x0008}),
                     "multi-frame files (enhanced CT) are not supported; convert to NIfTI, for "
                     "example with dcm2niix",
                     header.path().string());
}

void check_is_grey(const DicomElements& header) {
  const std::string file = header.path().string();
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

/// The lowest `bits` of a number, with the sign that these bits have.
std::int64_t number_of_bits(std::int64_t number, int bits, bool is_signed) {
  const std::int64_t range = std::int64_t{1} << bits;
  const std::int64_t value = number & (range - 1);
  return is_signed && value >= range / 2 ? value - range : value;
}

/// Files state padding as signed or not, whatever their pixels are, so only its bits count. The
/// limit may be the lower end (PS3.3, C.7.5.1.1.2).
void read_padding(const DicomElements& header, DicomPixelLayout& layout) {
  if (header.text(kPaddingValue).empty()) return;
  const auto stored = [&](DicomTag tag, const char* name) {
    constexpr int kElementBits = 16;
    return number_of_bits(required_integer(header, tag, name, -32768.0, 65535.0),
                          std::min(layout.allocated_bits, kElementBits),
                          layout.is_signed);
  };
  const std::int64_t value = stored(kPaddingValue, "PixelPaddingValue (0028,0120)");
  const std::int64_t limit = header.text(kPaddingLimit).empty()
                                 ? value
                                 : stored(kPaddingLimit, "PixelPaddingRangeLimit (0028,0121)");
  layout.padding = std::minmax({value, limit});
}

std::size_t pixel_count(const DicomPixelLayout& layout) {
  return static_cast<std::size_t>(layout.columns) * static_cast<std::size_t>(layout.rows);
}

std::size_t decoded_bytes(const DicomPixelLayout& layout) {
  return pixel_count(layout) * static_cast<std::size_t>(layout.allocated_bits) / 8;
}

void check_bytes(const DicomElements& header, const DicomPixelLayout& layout) {
  const std::string file = layout.path().string();
  const std::uint64_t expected =
      std::uint64_t{decoded_bytes(layout)} * static_cast<std::uint64_t>(layout.frames);
  if (!header.has_compressed_pixels() && header.pixel_bytes() < expected)
    throw FileError(file,
                    "pixel data",
                    std::to_string(expected) + " bytes",
                    std::to_string(header.pixel_bytes()));
  // No lossless codec packs an image with noise this tightly, while a blank one takes next to
  // nothing. Memory beyond that of any detector's frame is therefore not allocated on the header's
  // word.
  constexpr std::uint64_t kMaxCompression = 1000;
  constexpr std::size_t kLargestBlankFrame = std::size_t{1} << 27;
  if (decoded_bytes(layout) > kLargestBlankFrame &&
      expected / kMaxCompression > header.pixel_bytes())
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

/// The fragments of a frame. The first part of the pixels is the table of the frames' offsets,
/// which may be empty. Then every frame is one fragment, or there is only one frame.
std::vector<DicomPart> fragments_of_frame(const DicomPixelLayout& layout) {
  constexpr std::uint64_t kItemHeadBytes = 8;
  const std::vector<DicomPart>& parts = layout.header.pixel_parts();
  const std::string file = layout.path().string();
  if (parts.empty()) throw FileError(file, "has no compressed pixels");
  std::vector<DicomPart> fragments(parts.begin() + 1, parts.end());
  if (layout.frames == 1) return fragments;
  const auto frames = static_cast<std::size_t>(layout.frames);
  const auto at = static_cast<std::size_t>(layout.frame - 1);
  if (fragments.size() == frames) return {fragments[at]};
  if (parts.front().bytes != 4 * frames)
    throw FileError(file,
                    "table of frame offsets",
                    std::to_string(4 * frames) + " bytes for " + std::to_string(frames) + " frames",
                    std::to_string(parts.front().bytes) + " bytes and " +
                        std::to_string(fragments.size()) + " fragments");
  const std::vector<char> table = part_of_file(layout.path(), parts.front());
  const std::uint64_t first_item = parts.front().offset + parts.front().bytes;
  const auto offset = [&](std::size_t frame) {
    std::uint64_t value = 0;
    for (std::size_t byte = 4; byte-- > 0;)
      value = value << 8 | static_cast<unsigned char>(table[4 * frame + byte]);
    return first_item + value;
  };
  std::vector<DicomPart> found;
  for (const DicomPart& fragment : fragments) {
    const std::uint64_t item = fragment.offset - kItemHeadBytes;
    if (item >= offset(at) && (at + 1 == frames || item < offset(at + 1)))
      found.push_back(fragment);
  }
  if (found.empty())
    throw FileError(file,
                    "its table of offsets has nothing for frame " + std::to_string(layout.frame));
  return found;
}

gdcm::TransferSyntax::TSType compression_of(const DicomPixelLayout& layout) {
  const std::string syntax = layout.header.text({0x0002, 0x0010});
  const gdcm::TransferSyntax::TSType type = gdcm::TransferSyntax::GetTSType(syntax.c_str());
  if (type == gdcm::TransferSyntax::TS_END)
    throw InputError(
        "transfer syntax", syntax, "is not known to the decoder", layout.path().string());
  return type;
}

/// GDCM's image of what the file states, made without its parser.
gdcm::Image compressed_image(const DicomPixelLayout& layout,
                             gdcm::TransferSyntax::TSType compression,
                             const std::vector<std::vector<char>>& fragments) {
  const gdcm::SmartPointer<gdcm::SequenceOfFragments> sequence = new gdcm::SequenceOfFragments;
  for (const std::vector<char>& bytes : fragments) {
    gdcm::Fragment fragment;
    fragment.SetByteValue(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    sequence->AddFragment(fragment);
  }
  gdcm::DataElement pixels(gdcm::Tag(0x7fe0, 0x0010));
  pixels.SetVR(gdcm::VR::OB);
  pixels.SetValue(*sequence);
  gdcm::Image image;
  image.SetNumberOfDimensions(2);
  image.SetColumns(static_cast<unsigned>(layout.columns));
  image.SetRows(static_cast<unsigned>(layout.rows));
  image.SetTransferSyntax(compression);
  image.SetPixelFormat(gdcm::PixelFormat(1,
                                         static_cast<std::uint16_t>(layout.allocated_bits),
                                         static_cast<std::uint16_t>(layout.stored_bits),
                                         static_cast<std::uint16_t>(layout.high_bit),
                                         layout.is_signed ? 1 : 0));
  image.SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
  image.SetDataElement(pixels);
  return image;
}

/// Decodes by GDCM in a copy of the process, because its JPEG decoders end the process on damaged
/// frames. Version 3.0.21 does so by an assertion (gdcmJPEGBITSCodec.hxx:782).
std::vector<char> decompressed(const DicomPixelLayout& layout) {
  const gdcm::TransferSyntax::TSType compression = compression_of(layout);
  std::vector<std::vector<char>> fragments;
  for (const DicomPart& part : fragments_of_frame(layout))
    fragments.push_back(part_of_file(layout.path(), part));
  ContainedWork decoding = contained_work(decoded_bytes(layout), [&](std::span<char> pixels) {
    silence_gdcm();
    const gdcm::Image image = compressed_image(layout, compression, fragments);
    return image.GetBufferLength() == pixels.size() && image.GetBuffer(pixels.data());
  });
  if (!decoding.is_done)
    throw FileError(layout.path().string(),
                    "its compressed pixels are corrupt: their decoder " + decoding.trouble);
  return std::move(decoding.bytes);
}

/// What pixels hold before the rescale.
struct StoredPixels {
  std::vector<std::int64_t> values;
  std::vector<bool> is_padding;
};

/// Cuts the stored bits out of the allocated ones and extends the sign. Padding that does not fit
/// into the stored bits is compared with all bits.
StoredPixels stored_pixels(const std::vector<char>& raw,
                           bool is_big_endian,
                           const DicomPixelLayout& layout) {
  const auto pixel_bytes = static_cast<std::size_t>(layout.allocated_bits) / 8;
  const bool has_turned_words =
      is_big_endian && pixel_bytes == 1 && layout.header.has_pixel_words();
  const int shift = layout.high_bit + 1 - layout.stored_bits;
  const auto stored = [&](std::int64_t bits) {
    return number_of_bits(bits >> shift, layout.stored_bits, layout.is_signed);
  };
  const auto [low, high] = layout.padding.value_or(std::pair<std::int64_t, std::int64_t>(1, 0));
  const bool fits = low == number_of_bits(low, layout.stored_bits, layout.is_signed) &&
                    high == number_of_bits(high, layout.stored_bits, layout.is_signed);
  StoredPixels pixels;
  pixels.values.resize(pixel_count(layout));
  pixels.is_padding.resize(pixels.values.size());
  for (std::size_t i = 0; i < pixels.values.size(); ++i) {
    std::uint32_t bits = 0;
    for (std::size_t byte = 0; byte < pixel_bytes; ++byte) {
      const std::size_t at = is_big_endian ? byte : pixel_bytes - 1 - byte;
      const std::size_t place = i * pixel_bytes + at;
      bits = bits << 8 | static_cast<unsigned char>(
                             raw[has_turned_words ? std::min(place ^ 1, raw.size() - 1) : place]);
    }
    pixels.values[i] = stored(bits);
    const std::int64_t compared =
        fits ? pixels.values[i] : number_of_bits(bits, layout.allocated_bits, layout.is_signed);
    pixels.is_padding[i] = compared >= low && compared <= high;
  }
  return pixels;
}

/// Whether other pixels hold values below and above the padding, contrary to what DICOM says of it.
bool is_amid_data(const StoredPixels& pixels, const DicomPixelLayout& layout) {
  bool has_lower = false;
  bool has_higher = false;
  for (std::size_t i = 0; i < pixels.values.size(); ++i) {
    if (pixels.is_padding[i]) continue;
    has_lower = has_lower || pixels.values[i] < layout.padding->first;
    has_higher = has_higher || pixels.values[i] > layout.padding->second;
  }
  return has_lower && has_higher;
}

/// Keeps only the padding that is connected (4 neighbours) with the picture's edge.
std::vector<bool> part_at_edge(const std::vector<bool>& is_padding, std::size_t columns) {
  const std::size_t count = is_padding.size();
  std::vector<bool> found(count);
  std::vector<std::size_t> next;
  const auto visit = [&](std::size_t at) {
    if (!is_padding[at] || found[at]) return;
    found[at] = true;
    next.push_back(at);
  };
  for (std::size_t at = 0; at < count; ++at)
    if (at < columns || at + columns >= count || at % columns == 0 || (at + 1) % columns == 0)
      visit(at);
  while (!next.empty()) {
    const std::size_t at = next.back();
    next.pop_back();
    if (at % columns != 0) visit(at - 1);
    if ((at + 1) % columns != 0) visit(at + 1);
    if (at >= columns) visit(at - columns);
    if (at + columns < count) visit(at + columns);
  }
  return found;
}

DicomPixels rescaled(const std::vector<char>& raw,
                     bool is_big_endian,
                     const DicomPixelLayout& layout) {
  StoredPixels stored = stored_pixels(raw, is_big_endian, layout);
  DicomPixels pixels;
  if (layout.padding && is_amid_data(stored, layout)) {
    const auto all = std::count(stored.is_padding.begin(), stored.is_padding.end(), true);
    stored.is_padding = part_at_edge(stored.is_padding, static_cast<std::size_t>(layout.columns));
    pixels.doubtful = static_cast<std::size_t>(
        all - std::count(stored.is_padding.begin(), stored.is_padding.end(), true));
  }
  pixels.values.reserve(stored.values.size());
  for (std::size_t i = 0; i < stored.values.size(); ++i) {
    if (stored.is_padding[i]) ++pixels.padded;
    pixels.values.push_back(stored.is_padding[i]
                                ? std::numeric_limits<double>::quiet_NaN()
                                : static_cast<double>(stored.values[i]) * layout.slope +
                                      layout.intercept);
  }
  return pixels;
}

}  // namespace

std::pair<double, double> DicomPixelLayout::value_range() const {
  const std::int64_t range = std::int64_t{1} << stored_bits;
  const std::int64_t low = is_signed ? -range / 2 : 0;
  return {static_cast<double>(low) * slope + intercept,
          static_cast<double>(low + range - 1) * slope + intercept};
}

std::string DicomPixelLayout::padding_text() const {
  const std::string limit = header.text(kPaddingLimit);
  return "PixelPaddingValue " + header.text(kPaddingValue) + (limit.empty() ? "" : " to " + limit);
}

DicomPixelLayout dicom_pixel_layout(const DicomElements& header) {
  check_is_one_frame(header);
  return dicom_frame_layout(header, std::nullopt);
}

DicomPixelLayout dicom_frame_layout(const DicomElements& header, std::optional<int> frame) {
  check_is_grey(header);
  DicomPixelLayout layout;
  layout.header = header;
  if (!header.text({0x0028, 0x0008}).empty())
    layout.frames = required_integer(header, {0x0028, 0x0008}, "NumberOfFrames", 1, kMaxFrames);
  if (!frame && layout.frames > 1)
    throw InputError("NumberOfFrames",
                     std::to_string(layout.frames),
                     "say which frame to read, from 1 (xray_frame in the study)",
                     header.path().string());
  layout.frame = frame.value_or(1);
  if (layout.frame < 1 || layout.frame > layout.frames)
    throw InputError(
        "frame",
        std::to_string(layout.frame),
        "must be 1 to " + std::to_string(layout.frames) + ", the file's NumberOfFrames",
        header.path().string());
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
  read_padding(header, layout);
  check_bytes(header, layout);
  return layout;
}

DicomPixels read_dicom_pixels(const DicomPixelLayout& layout) {
  if (layout.header.has_compressed_pixels()) return rescaled(decompressed(layout), false, layout);
  DicomPart part = layout.header.pixel_parts().front();
  part.bytes = static_cast<std::uint32_t>(decoded_bytes(layout));  // fits: the part holds it
  part.offset += std::uint64_t{part.bytes} * static_cast<std::uint64_t>(layout.frame - 1);
  return rescaled(part_of_file(layout.path(), part), layout.header.is_big_endian(), layout);
}

}  // namespace af
