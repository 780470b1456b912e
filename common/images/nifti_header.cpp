// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/plausible.h"
#include "files/csv_table.h"
#include "geometry/ct_grid.h"
#include "images/file_bytes.h"
#include "images/image_formats.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

constexpr float kMaxOrientation = 1e6f;
constexpr float kMaxSlope = 1e6f;
/// A quaternion in single precision near half a turn is off by sqrt(6e-8) rad, or 0.06 mm at the
/// corners of a volume 500 mm wide.
constexpr double kMaxPlaceDifferenceMm = 0.05;
constexpr std::size_t kNifti2HeaderBytes = 540;

/// A voxel's type: the type of each channel, and how many there are.
struct NiftiType {
  ValueType type = ValueType::Int16;
  std::uint64_t channels = 1;
};

NiftiType nifti_type(const std::string& path, int datatype) {
  static const std::map<int, NiftiType> type_of_code = {{2, {ValueType::UInt8}},
                                                        {4, {ValueType::Int16}},
                                                        {8, {ValueType::Int32}},
                                                        {16, {ValueType::Float32}},
                                                        {64, {ValueType::Float64}},
                                                        {128, {ValueType::UInt8, 3}},
                                                        {256, {ValueType::Int8}},
                                                        {512, {ValueType::UInt16}},
                                                        {768, {ValueType::UInt32}},
                                                        {1024, {ValueType::Int64}},
                                                        {1280, {ValueType::UInt64}},
                                                        {2304, {ValueType::UInt8, 4}}};
  const auto found = type_of_code.find(datatype);
  if (found == type_of_code.end())
    throw FileError(path, "datatype", "a real number type of NIfTI-1", std::to_string(datatype));
  return found->second;
}

/// Maps of voxel index to RAS+ mm, as grids of spacing 1 whose axes are as long as voxels.
CtGrid qform_map(std::string_view raw, bool swapped) {
  const auto at = [&](std::size_t offset) {
    return static_cast<double>(number_at<float>(raw, offset, swapped));
  };
  const Eigen::Vector3d q(at(256), at(260), at(264));
  const double w = std::sqrt(std::max(0.0, 1.0 - q.squaredNorm()));
  const double handedness = at(76) < 0.0 ? -1.0 : 1.0;
  CtGrid map;
  map.direction = Eigen::Quaterniond(w, q.x(), q.y(), q.z()).normalized().toRotationMatrix() *
                  Eigen::Vector3d(at(80), at(84), handedness * at(88)).asDiagonal();
  map.origin_mm = {at(268), at(272), at(276)};
  return map;
}

CtGrid sform_map(std::string_view raw, bool swapped) {
  CtGrid map;
  for (Eigen::Index row = 0; row < 3; ++row) {
    const auto at = [&](std::size_t column) {
      const std::size_t number = 4 * static_cast<std::size_t>(row) + column;
      return static_cast<double>(number_at<float>(raw, 280 + 4 * number, swapped));
    };
    map.direction.row(row) << at(0), at(1), at(2);
    map.origin_mm[row] = at(3);
  }
  return map;
}

/// Length along the axis, from the first voxel's centre to the last one's.
double extent_mm(const ImageHeader& header, std::size_t axis, double spacing_mm) {
  return static_cast<double>(header.image.size[axis] - 1) * spacing_mm;
}

/// The sform's axes must be those of pixdim: a map that is flat, or has other lengths, is no grid.
void check_lengths(const std::string& path, const ImageHeader& header, const CtGrid& sform) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double length = sform.direction.col(static_cast<Eigen::Index>(axis)).norm();
    if (!(std::abs(length / header.image.spacing_mm[axis] - 1.0) <= kMaxDirectionError))
      throw InputError("sform",
                       "an axis of " + number_text(length) + " mm per voxel",
                       "must be as long as pixdim says, " +
                           number_text(header.image.spacing_mm[axis]) +
                           " (a scaled or singular map is not supported; resample the CT)",
                       path);
  }
}

/// Where a volume lies. The sform counts when it leads to the scanner's coordinates (code 1),
/// otherwise the qform, as in ITK.
void place_volume(const std::string& path,
                  std::string_view raw,
                  bool swapped,
                  ImageHeader& header) {
  const int qform_code = number_at<std::int16_t>(raw, 252, swapped);
  const int sform_code = number_at<std::int16_t>(raw, 254, swapped);
  header.has_orientation = qform_code > 0 || sform_code > 0;
  if (!header.has_orientation || header.image.size.size() < 3) return;
  CtGrid qform = qform_map(raw, swapped);
  CtGrid sform = sform_map(raw, swapped);
  for (std::size_t axis = 0; axis < 3; ++axis)
    qform.size[axis] = sform.size[axis] = static_cast<int>(header.image.size[axis]);
  const bool is_by_sform = sform_code == 1 || qform_code <= 0;
  if (is_by_sform) check_lengths(path, header, sform);
  if (qform_code > 0 && sform_code > 0 &&
      largest_corner_shift_mm(qform, sform) > kMaxPlaceDifferenceMm)
    header.warnings.push_back(path + ": sform and qform place the CT differently; the " +
                              (is_by_sform ? "sform" : "qform") + " is used");
  const CtGrid& ras = is_by_sform ? sform : qform;
  const Eigen::Vector3d lps_from_ras(-1.0, -1.0, 1.0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    const Eigen::Vector3d column = lps_from_ras.cwiseProduct(ras.direction.col(i));
    const Eigen::Vector3d unit = column.normalized();
    header.image.directions[axis].assign(unit.begin(), unit.end());
    header.image.origin_mm[axis] = lps_from_ras[i] * ras.origin_mm[i] + 0.0;  // no -0
    // Takes pixdim where the two agree to what tells CTs apart, because both are rounded to single
    // precision.
    if (extent_mm(header, axis, std::abs(column.norm() - header.image.spacing_mm[axis])) >
        kSamePlaceMm)
      header.image.spacing_mm[axis] = column.norm();
  }
}

void check_nifti_numbers(const std::string& path, std::string_view raw, bool swapped) {
  const int units = number_at<char>(raw, 123, false) & 7;
  if (units == 1 || units == 3)
    throw InputError("xyzt_units",
                     units == 1 ? "metres" : "micrometres",
                     "lengths must be in mm (unit code 2)",
                     path);
  for (std::size_t axis = 1; axis <= 3; ++axis) {
    const float spacing = number_at<float>(raw, 76 + 4 * axis, swapped);
    if (axis <= static_cast<std::size_t>(number_at<std::int16_t>(raw, 40, swapped)) &&
        !is_plausible_spacing_mm(static_cast<double>(spacing)))
      throw InputError("pixdim[" + std::to_string(axis) + "]",
                       number_text(static_cast<double>(spacing)),
                       std::string("spacing ") + kPlausibleSpacing,
                       path);
  }
  // The quaternion, the offsets, and the rows of the sform.
  for (std::size_t offset = 256; offset < 328; offset += 4) {
    const float value = std::abs(number_at<float>(raw, offset, swapped));
    if (!(value < kMaxOrientation))
      throw InputError("orientation (header byte " + std::to_string(offset) + ")",
                       number_text(static_cast<double>(value)),
                       "must be finite and below 1e6",
                       path);
  }
}

/// A slope of 0 means that there is none. So does one that is not finite, for the format's own
/// library (nifti1_io.c, FIXED_FLOAT) and for nibabel, which writes NaN.
void read_rescale(const std::string& path,
                  std::string_view raw,
                  bool swapped,
                  ImageHeader& header) {
  const float slope = number_at<float>(raw, 112, swapped);
  const float intercept = number_at<float>(raw, 116, swapped);
  if (slope == 0.0f || !std::isfinite(slope)) return;
  if (!(std::abs(slope) <= kMaxSlope && std::abs(intercept) <= kMaxSlope) ||
      std::abs(slope) < 1.0f / kMaxSlope)
    throw InputError("scl_slope, scl_inter",
                     number_text(static_cast<double>(slope)) + ", " +
                         number_text(static_cast<double>(intercept)),
                     "must be at most 1e6, the slope 0 or at least 1e-6",
                     path);
  header.slope = static_cast<double>(slope);
  header.intercept = static_cast<double>(intercept);
  header.is_rescaled = header.slope != 1.0 || header.intercept != 0.0;
}

}  // namespace

ImageHeader read_nifti_header(const fs::path& path) {
  const std::string name = path.string();
  const std::string raw = read_inflated_prefix(path, kNifti1HeaderBytes);
  if (raw.size() < kNifti1HeaderBytes)
    throw FileError(name, "NIfTI header", "348 bytes", std::to_string(raw.size()));
  const auto header_bytes = number_at<std::int32_t>(raw, 0, false);
  const bool swapped = header_bytes != static_cast<std::int32_t>(kNifti1HeaderBytes);
  if (header_bytes == static_cast<std::int32_t>(kNifti2HeaderBytes) ||
      number_at<std::int32_t>(raw, 0, true) == static_cast<std::int32_t>(kNifti2HeaderBytes))
    throw FileError(name, "NIfTI-2 is not supported; convert to NIfTI-1 (.nii.gz)");
  if (swapped &&
      number_at<std::int32_t>(raw, 0, true) != static_cast<std::int32_t>(kNifti1HeaderBytes))
    throw FileError(name, "sizeof_hdr", "348", std::to_string(header_bytes));
  if (raw.compare(344, 3, "n+1") != 0)
    throw FileError(name, "pairs of .hdr and .img are not supported; convert to .nii.gz");

  ImageHeader header;
  header.format = ImageFormat::Nifti;
  header.data_file = path;
  header.compressed = is_gzip(read_prefix(path, 2));
  const int dimension = number_at<std::int16_t>(raw, 40, swapped);
  if (dimension < 1 || dimension > 7)
    throw FileError(name, "dim[0]", "1 to 7", std::to_string(dimension));
  for (int axis = 1; axis <= dimension; ++axis) {
    const int extent =
        number_at<std::int16_t>(raw, 40 + 2 * static_cast<std::size_t>(axis), swapped);
    if (extent < 1)
      throw FileError(
          name, "dim[" + std::to_string(axis) + "]", "at least 1", std::to_string(extent));
    header.image.size.push_back(static_cast<std::uint64_t>(extent));
    header.image.spacing_mm.push_back(static_cast<double>(
        number_at<float>(raw, 76 + 4 * static_cast<std::size_t>(axis), swapped)));
  }
  set_default_place(header);
  const NiftiType type = nifti_type(name, number_at<std::int16_t>(raw, 70, swapped));
  header.value_type = type.type;
  header.image.channels = static_cast<int>(type.channels);
  const int bits = number_at<std::int16_t>(raw, 72, swapped);
  if (static_cast<std::uint64_t>(bits) != 8 * header.voxel_bytes())
    throw FileError(name, "bitpix", std::to_string(8 * header.voxel_bytes()), std::to_string(bits));
  const float offset = number_at<float>(raw, 108, swapped);
  if (!(offset >= 352.0f && offset <= 1e9f))
    throw FileError(name, "vox_offset", "352 to 1e9", std::to_string(offset));
  header.skip_bytes = static_cast<std::uint64_t>(offset);
  check_nifti_numbers(name, raw, swapped);
  read_rescale(name, raw, swapped, header);
  header.is_byte_swapped = swapped;
  place_volume(name, raw, swapped, header);
  return header;
}

}  // namespace af::image_formats
