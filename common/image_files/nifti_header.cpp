// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "base/error.h"
#include "base/plausible.h"
#include "image_files/file_bytes.h"
#include "image_files/image_formats.h"
#include "image_files/itk_image_io.h"
#include "text/csv_table.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

constexpr float kMaxOrientation = 1e6f;
constexpr float kMinOrientation = 1e-30f;
constexpr float kMaxSlope = 1e6f;
constexpr std::size_t kNifti2HeaderBytes = 540;

template <typename T>
T load(std::string_view bytes, std::size_t offset, bool swapped) {
  std::array<char, sizeof(T)> raw{};
  std::copy_n(bytes.data() + offset, sizeof(T), raw.begin());
  if (swapped) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

/// A voxel's type: of each channel, and how many there are.
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

RasAffine qform_affine(std::string_view raw, bool swapped) {
  const auto at = [&](std::size_t offset) {
    return static_cast<double>(load<float>(raw, offset, swapped));
  };
  const Eigen::Vector3d q(at(256), at(260), at(264));
  const double w = std::sqrt(std::max(0.0, 1.0 - q.squaredNorm()));
  const double handedness = at(76) < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d linear =
      Eigen::Quaterniond(w, q.x(), q.y(), q.z()).normalized().toRotationMatrix() *
      Eigen::Vector3d(at(80), at(84), handedness * at(88)).asDiagonal();
  RasAffine affine{};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column)
      affine[row][column] =
          linear(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column));
    affine[row][3] = at(268 + 4 * row);
  }
  return affine;
}

RasAffine sform_affine(std::string_view raw, bool swapped) {
  RasAffine affine{};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 4; ++column)
      affine[row][column] =
          static_cast<double>(load<float>(raw, 280 + 4 * (4 * row + column), swapped));
  return affine;
}

/// ITK decomposes a map that is not orthogonal, prints its complaint, and may accept a flat one.
void check_is_orthogonal(const std::string& path, const char* name, const RasAffine& affine) {
  constexpr double kMaxShear = 1e-3;  // cosine between axes
  Eigen::Matrix3d axes;
  for (Eigen::Index row = 0; row < 3; ++row)
    for (Eigen::Index column = 0; column < 3; ++column)
      axes(row, column) = affine[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
  const Eigen::Matrix3d unit = axes.colwise().normalized();
  const Eigen::Matrix3d gram = unit.transpose() * unit;
  if (!gram.allFinite() ||
      !((gram - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= kMaxShear))
    throw InputError(
        name, "a sheared or singular map", "its axes must be orthogonal; resample the CT", path);
}

NiftiOrientation nifti_orientation(std::string_view raw, bool swapped) {
  NiftiOrientation orientation;
  if (load<std::int16_t>(raw, 252, swapped) > 0) orientation.qform = qform_affine(raw, swapped);
  if (load<std::int16_t>(raw, 254, swapped) > 0) orientation.sform = sform_affine(raw, swapped);
  return orientation;
}

void check_nifti_numbers(const std::string& path, std::string_view raw, bool swapped) {
  const int units = load<char>(raw, 123, false) & 7;
  if (units == 1 || units == 3)
    throw InputError("xyzt_units",
                     units == 1 ? "metres" : "micrometres",
                     "lengths must be in mm (unit code 2)",
                     path);
  for (std::size_t axis = 1; axis <= 3; ++axis) {
    const float spacing = load<float>(raw, 76 + 4 * axis, swapped);
    if (axis <= static_cast<std::size_t>(load<std::int16_t>(raw, 40, swapped)) &&
        !is_plausible_spacing_mm(static_cast<double>(spacing)))
      throw InputError("pixdim[" + std::to_string(axis) + "]",
                       number_text(static_cast<double>(spacing)),
                       std::string("spacing ") + kPlausibleSpacing,
                       path);
  }
  // Quaternion, offsets, and the rows of the sform. What is not finite makes ITK's singular value
  // decomposition run for ever, what is next to nothing makes it print.
  for (std::size_t offset = 256; offset < 328; offset += 4) {
    const float value = std::abs(load<float>(raw, offset, swapped));
    if (!(value < kMaxOrientation) || (value > 0.0f && value < kMinOrientation))
      throw InputError("orientation (header byte " + std::to_string(offset) + ")",
                       number_text(static_cast<double>(value)),
                       "must be finite, 0 or between 1e-30 and 1e6",
                       path);
  }
  const float slope = load<float>(raw, 112, swapped);
  const float intercept = load<float>(raw, 116, swapped);
  // ITK takes a next to nothing slope for none.
  if (!(std::abs(slope) <= kMaxSlope && std::abs(intercept) <= kMaxSlope) ||
      (slope != 0.0f && std::abs(slope) < 1.0f / kMaxSlope))
    throw InputError("scl_slope, scl_inter",
                     number_text(static_cast<double>(slope)) + ", " +
                         number_text(static_cast<double>(intercept)),
                     "must be at most 1e6, the slope 0 or at least 1e-6",
                     path);
}

}  // namespace

ImageHeader read_nifti_header(const fs::path& path) {
  const std::string name = path.string();
  const std::string raw = read_inflated_prefix(path, kNifti1HeaderBytes);
  if (raw.size() < kNifti1HeaderBytes)
    throw FileError(name, "NIfTI header", "348 bytes", std::to_string(raw.size()));
  const auto header_bytes = load<std::int32_t>(raw, 0, false);
  const bool swapped = header_bytes != static_cast<std::int32_t>(kNifti1HeaderBytes);
  if (header_bytes == static_cast<std::int32_t>(kNifti2HeaderBytes) ||
      load<std::int32_t>(raw, 0, true) == static_cast<std::int32_t>(kNifti2HeaderBytes))
    throw FileError(name, "NIfTI-2 is not supported; convert to NIfTI-1 (.nii.gz)");
  if (swapped && load<std::int32_t>(raw, 0, true) != static_cast<std::int32_t>(kNifti1HeaderBytes))
    throw FileError(name, "sizeof_hdr", "348", std::to_string(header_bytes));
  if (raw.compare(344, 3, "n+1") != 0)
    throw FileError(name, "pairs of .hdr and .img are not supported; convert to .nii.gz");

  ImageHeader header;
  header.format = ImageFormat::Nifti;
  header.data_file = path;
  header.compressed = is_gzip(read_prefix(path, 2));
  const int dimension = load<std::int16_t>(raw, 40, swapped);
  if (dimension < 1 || dimension > 7)
    throw FileError(name, "dim[0]", "1 to 7", std::to_string(dimension));
  for (int axis = 1; axis <= dimension; ++axis) {
    const int extent = load<std::int16_t>(raw, 40 + 2 * static_cast<std::size_t>(axis), swapped);
    if (extent < 1)
      throw FileError(
          name, "dim[" + std::to_string(axis) + "]", "at least 1", std::to_string(extent));
    header.size.push_back(static_cast<std::uint64_t>(extent));
  }
  const NiftiType type = nifti_type(name, load<std::int16_t>(raw, 70, swapped));
  header.value_type = type.type;
  header.value_bytes = value_bytes(type.type) * type.channels;
  const int bits = load<std::int16_t>(raw, 72, swapped);
  if (static_cast<std::uint64_t>(bits) != 8 * header.value_bytes)
    throw FileError(name, "bitpix", std::to_string(8 * header.value_bytes), std::to_string(bits));
  const float offset = load<float>(raw, 108, swapped);
  if (!(offset >= 352.0f && offset <= 1e9f))
    throw FileError(name, "vox_offset", "352 to 1e9", std::to_string(offset));
  header.skip_bytes = static_cast<std::uint64_t>(offset);
  check_nifti_numbers(name, raw, swapped);
  const float slope = load<float>(raw, 112, swapped);
  const float intercept = load<float>(raw, 116, swapped);
  header.is_byte_swapped = swapped;
  // A slope of 0 means that there is none.
  header.slope = slope == 0.0f ? 1.0 : static_cast<double>(slope);
  header.intercept = slope == 0.0f ? 0.0 : static_cast<double>(intercept);
  header.is_rescaled = header.slope != 1.0 || header.intercept != 0.0;
  header.nifti = nifti_orientation(raw, swapped);
  if (header.nifti.sform) check_is_orthogonal(name, "sform", *header.nifti.sform);
  header.has_orientation = header.nifti.qform.has_value() || header.nifti.sform.has_value();
  return header;
}

}  // namespace af::image_formats
