// SPDX-License-Identifier: Apache-2.0
#include "image_files/dicom_xray_writer.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <span>

#include "base/error.h"
#include "base/number_text.h"
#include "files/output_file.h"
#include "files/sha256.h"

namespace af {

namespace {

constexpr double kDegreesPerRadian = 180.0 / M_PI;
constexpr const char* kXaStorage = "1.2.840.10008.5.1.4.1.1.12.1";
constexpr const char* kExplicitLittleEndian = "1.2.840.10008.1.2.1";

void append_number(std::string& bytes, std::uint64_t value, int count) {
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
}

/// Elements in the order of their tags.
class ElementWriter {
 public:
  void text(std::uint16_t group, std::uint16_t element, const char* form, std::string value) {
    if (value.size() % 2 != 0) value += std::string_view(form) == "UI" ? '\0' : ' ';
    head(group, element, form);
    append_number(bytes_, value.size(), 2);
    bytes_ += value;
  }
  void u16(std::uint16_t group, std::uint16_t element, int value) {
    head(group, element, "US");
    append_number(bytes_, 2, 2);
    append_number(bytes_, static_cast<std::uint64_t>(value), 2);
  }
  void u32(std::uint16_t group, std::uint16_t element, std::uint64_t value) {
    head(group, element, "UL");
    append_number(bytes_, 4, 2);
    append_number(bytes_, value, 4);
  }
  /// Bytes of a form with a long length.
  void long_bytes(std::uint16_t group,
                  std::uint16_t element,
                  const char* form,
                  const std::string& value) {
    head(group, element, form);
    append_number(bytes_, 0, 2);
    append_number(bytes_, value.size(), 4);
    bytes_ += value;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  void head(std::uint16_t group, std::uint16_t element, const char* form) {
    append_number(bytes_, group, 2);
    append_number(bytes_, element, 2);
    bytes_ += form;
  }
  std::string bytes_;
};

/// A decimal string has at most 16 characters.
std::string decimal(double value) {
  constexpr int kDigits = 9;
  std::array<char, 32> text{};
  const auto [end, error] = std::to_chars(
      text.data(), text.data() + text.size(), value + 0.0, std::chars_format::general, kDigits);
  check(error == std::errc(), "a number has a text");
  return {text.data(), end};
}

/// Below 2.25, the root of UIDs that are made of a UUID.
std::string uid_of(const std::string& content) {
  const std::string hash = sha256_hex(std::as_bytes(std::span(content)));
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(hash.data(), hash.data() + 16, value, 16);
  check(error == std::errc() && end == hash.data() + 16, "a hash is hexadecimal");
  return "2.25." + std::to_string(value);
}

std::string stored_pixels(const Image2d& levels, int stored_bits) {
  const int white = (1 << stored_bits) - 1;
  std::string bytes;
  bytes.reserve(2 * levels.pixels.size());
  for (const float level : levels.pixels) {
    const auto grey = static_cast<int>(std::nearbyint(level));
    append_number(bytes, static_cast<std::uint64_t>(white - std::clamp(grey, 0, white)), 2);
  }
  return bytes;
}

}  // namespace

Eigen::Vector2d positioner_angles_deg(const Eigen::Vector3d& beam_direction_ct) {
  const Eigen::Vector3d beam = beam_direction_ct.normalized();
  return kDegreesPerRadian * Eigen::Vector2d(std::atan2(beam.x(), -beam.y()),
                                             std::asin(std::clamp(beam.z(), -1.0, 1.0)));
}

std::string patient_orientation_letters(const Eigen::Vector3d& direction_ct) {
  constexpr std::array<std::array<char, 2>, 3> kLetters = {{{'L', 'R'}, {'P', 'A'}, {'H', 'F'}}};
  constexpr double kLeast = 0.1;
  std::array<std::size_t, 3> axes = {0, 1, 2};
  const auto size = [&](std::size_t axis) {
    return std::abs(direction_ct[static_cast<Eigen::Index>(axis)]);
  };
  std::stable_sort(
      axes.begin(), axes.end(), [&](std::size_t a, std::size_t b) { return size(a) > size(b); });
  std::string letters;
  for (const std::size_t axis : axes)
    if (size(axis) >= kLeast)
      letters += kLetters[axis][direction_ct[static_cast<Eigen::Index>(axis)] > 0.0 ? 0 : 1];
  return letters;
}

void write_dicom_xray(const Image2d& levels,
                      const std::filesystem::path& path,
                      const DicomXrayDescription& description) {
  check(description.stored_bits >= 8 && description.stored_bits <= 16, "8 to 16 bits are stored");
  constexpr int kMostSide = 65535;
  if (levels.width > kMostSide || levels.height > kMostSide)
    throw InputError("size",
                     std::to_string(levels.width) + " x " + std::to_string(levels.height) + " px",
                     "a DICOM image has at most 65535 columns and rows",
                     path.string());
  const std::string pixels = stored_pixels(levels, description.stored_bits);
  const std::string study_uid = uid_of("study " + description.patient_id);
  const std::string series_uid =
      uid_of("series " + description.patient_id + "/" + description.description);
  const std::string instance_uid = uid_of(series_uid + pixels);
  const auto pair = [](double first, double second) {
    return decimal(first) + "\\" + decimal(second);
  };

  ElementWriter data;
  data.text(0x0008, 0x0008, "CS", "ORIGINAL\\PRIMARY\\SINGLE PLANE");
  data.text(0x0008, 0x0016, "UI", kXaStorage);
  data.text(0x0008, 0x0018, "UI", instance_uid);
  data.text(0x0008, 0x0060, "CS", "XA");
  data.text(0x0008, 0x103e, "LO", description.description);
  data.text(0x0010, 0x0010, "PN", description.patient_id);
  data.text(0x0010, 0x0020, "LO", description.patient_id);
  data.text(0x0018, 0x1110, "DS", decimal(description.source_detector_mm));
  data.text(0x0018, 0x1111, "DS", decimal(description.source_patient_mm));
  data.text(0x0018,
            0x1164,
            "DS",
            pair(description.imager_spacing_mm.y(), description.imager_spacing_mm.x()));
  data.text(0x0018, 0x1510, "DS", decimal(description.primary_angle_deg));
  data.text(0x0018, 0x1511, "DS", decimal(description.secondary_angle_deg));
  data.text(0x0020, 0x000d, "UI", study_uid);
  data.text(0x0020, 0x000e, "UI", series_uid);
  data.text(0x0020, 0x0013, "IS", "1");
  if (!description.column_direction_ct.isZero(0.0))
    data.text(0x0020,
              0x0020,
              "CS",
              patient_orientation_letters(description.column_direction_ct) + "\\" +
                  patient_orientation_letters(description.row_direction_ct));
  data.u16(0x0028, 0x0002, 1);
  data.text(0x0028, 0x0004, "CS", "MONOCHROME1");
  data.u16(0x0028, 0x0010, levels.height);
  data.u16(0x0028, 0x0011, levels.width);
  data.u16(0x0028, 0x0100, 16);
  data.u16(0x0028, 0x0101, description.stored_bits);
  data.u16(0x0028, 0x0102, description.stored_bits - 1);
  data.u16(0x0028, 0x0103, 0);
  data.text(0x0028, 0x1040, "CS", "LIN");
  data.long_bytes(0x7fe0, 0x0010, "OW", pixels);

  ElementWriter meta;
  meta.long_bytes(0x0002, 0x0001, "OB", std::string("\0\1", 2));
  meta.text(0x0002, 0x0002, "UI", kXaStorage);
  meta.text(0x0002, 0x0003, "UI", instance_uid);
  meta.text(0x0002, 0x0010, "UI", kExplicitLittleEndian);
  meta.text(0x0002, 0x0012, "UI", uid_of("attenuation fields"));
  ElementWriter length;
  length.u32(0x0002, 0x0000, meta.bytes().size());
  write_text_file(path,
                  std::string(128, '\0') + "DICM" + length.bytes() + meta.bytes() + data.bytes());
}

}  // namespace af
