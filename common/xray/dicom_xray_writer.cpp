// SPDX-License-Identifier: Apache-2.0
#include "xray/dicom_xray_writer.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <gdcmWriter.h>
#include <span>
#include <sstream>

#include "base/error.h"
#include "base/number_text.h"
#include "files/output_file.h"
#include "files/sha256.h"

namespace af {

namespace {

constexpr double kDegreesPerRadian = 180.0 / M_PI;
constexpr const char* kXaStorage = "1.2.840.10008.5.1.4.1.1.12.1";

std::string two_bytes(int value) {
  return {static_cast<char>(value & 0xff), static_cast<char>(value >> 8 & 0xff)};
}

void add(gdcm::DataSet& data, const gdcm::Tag& tag, gdcm::VR::VRType form, std::string value) {
  if (value.size() % 2 != 0) value += form == gdcm::VR::UI ? '\0' : ' ';
  gdcm::DataElement element(tag);
  element.SetVR(form);
  element.SetByteValue(value.data(), static_cast<std::uint32_t>(value.size()));
  data.Insert(element);
}

/// Text of at most 16 characters, the limit of a decimal string.
std::string decimal(double value) {
  constexpr int kDigits = 9;
  std::array<char, 32> text{};
  const auto [end, error] = std::to_chars(
      text.data(), text.data() + text.size(), value + 0.0, std::chars_format::general, kDigits);
  check(error == std::errc(), "a number has a text");
  return {text.data(), end};
}

/// A UID below 2.25, the root of UIDs made from a UUID.
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
    bytes += two_bytes(white - std::clamp(grey, 0, white));
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

  gdcm::Writer writer;
  gdcm::DataSet& data = writer.GetFile().GetDataSet();
  add(data, {0x0008, 0x0008}, gdcm::VR::CS, "ORIGINAL\\PRIMARY\\SINGLE PLANE");
  add(data, {0x0008, 0x0016}, gdcm::VR::UI, kXaStorage);
  add(data, {0x0008, 0x0018}, gdcm::VR::UI, instance_uid);
  add(data, {0x0008, 0x0060}, gdcm::VR::CS, "XA");
  add(data, {0x0008, 0x103e}, gdcm::VR::LO, description.description);
  add(data, {0x0010, 0x0010}, gdcm::VR::PN, description.patient_id);
  add(data, {0x0010, 0x0020}, gdcm::VR::LO, description.patient_id);
  add(data, {0x0018, 0x1110}, gdcm::VR::DS, decimal(description.source_detector_mm));
  add(data, {0x0018, 0x1111}, gdcm::VR::DS, decimal(description.source_patient_mm));
  add(data,
      {0x0018, 0x1164},
      gdcm::VR::DS,
      pair(description.imager_spacing_mm.y(), description.imager_spacing_mm.x()));
  add(data, {0x0018, 0x1510}, gdcm::VR::DS, decimal(description.primary_angle_deg));
  add(data, {0x0018, 0x1511}, gdcm::VR::DS, decimal(description.secondary_angle_deg));
  add(data, {0x0020, 0x000d}, gdcm::VR::UI, study_uid);
  add(data, {0x0020, 0x000e}, gdcm::VR::UI, series_uid);
  add(data, {0x0020, 0x0013}, gdcm::VR::IS, "1");
  if (!description.column_direction_ct.isZero(0.0))
    add(data,
        {0x0020, 0x0020},
        gdcm::VR::CS,
        patient_orientation_letters(description.column_direction_ct) + "\\" +
            patient_orientation_letters(description.row_direction_ct));
  add(data, {0x0028, 0x0002}, gdcm::VR::US, two_bytes(1));
  add(data, {0x0028, 0x0004}, gdcm::VR::CS, "MONOCHROME1");
  add(data, {0x0028, 0x0010}, gdcm::VR::US, two_bytes(levels.height));
  add(data, {0x0028, 0x0011}, gdcm::VR::US, two_bytes(levels.width));
  add(data, {0x0028, 0x0100}, gdcm::VR::US, two_bytes(16));
  add(data, {0x0028, 0x0101}, gdcm::VR::US, two_bytes(description.stored_bits));
  add(data, {0x0028, 0x0102}, gdcm::VR::US, two_bytes(description.stored_bits - 1));
  add(data, {0x0028, 0x0103}, gdcm::VR::US, two_bytes(0));
  add(data, {0x0028, 0x1040}, gdcm::VR::CS, "LIN");
  add(data, {0x7fe0, 0x0010}, gdcm::VR::OW, pixels);
  writer.GetFile().GetHeader().SetDataSetTransferSyntax(
      gdcm::TransferSyntax::ExplicitVRLittleEndian);
  std::ostringstream file;
  writer.SetStream(file);
  check(writer.Write(), "GDCM writes what it is given");
  write_text_file(path, file.str());
}

}  // namespace af
