// SPDX-License-Identifier: Apache-2.0
#include "io/dicom_series.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <gdcmImageReader.h>
#include <gdcmReader.h>
#include <gdcmStringFilter.h>
#include <gdcmTrace.h>
#include <map>
#include <optional>
#include <sstream>

#include <Eigen/Geometry>

#include "base/error.h"

namespace af {

namespace fs = std::filesystem;

namespace {

// Tolerances on what one scanner writes for one stack.
constexpr double kMaxCosineDifference = 1e-4;  ///< of direction cosines between slices (0.006 deg)
constexpr double kMaxCosineError = 1e-3;       ///< from orthonormal; decimal strings are rounded
constexpr double kMaxSpacingShare = 1e-3;      ///< of in-plane pixel spacing between slices
constexpr double kUnevenShare = 0.01;          ///< of the slice distance
constexpr double kUnevenMm = 0.01;
constexpr double kMaxDriftPixels = 0.1;  ///< of a slice from the line along the normal
constexpr double kMaxDriftMm = 0.05;
constexpr double kMaxGantryTiltDeg = 0.01;
constexpr std::size_t kMaxVoxels = std::size_t{1} << 32;

const char* const kMediaStorageDirectory = "1.2.840.10008.1.3.10";

void silence_gdcm() {
  static const bool kDone = [] {
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    gdcm::Trace::DebugOff();
    return true;
  }();
  (void)kDone;
}

std::string trimmed(std::string text) {
  const auto is_padding = [](char c) { return c == ' ' || c == '\0' || c == '\t'; };
  while (!text.empty() && is_padding(text.back())) text.pop_back();
  std::size_t first = 0;
  while (first < text.size() && is_padding(text[first])) ++first;
  return text.substr(first);
}

std::string number(double value) {
  std::ostringstream text;
  text << value;  // six significant digits
  return text.str();
}

/// The header of one DICOM file, up to its pixels.
class DicomHeader {
 public:
  /// nullopt when GDCM cannot parse the file.
  static std::optional<DicomHeader> read(const fs::path& path) {
    silence_gdcm();
    gdcm::Reader reader;
    reader.SetFileName(path.c_str());
    try {
      if (!reader.ReadUpToTag(gdcm::Tag(0x7fe0, 0x0010))) return std::nullopt;
    } catch (const std::exception&) {
      return std::nullopt;
    }
    DicomHeader header;
    header.file_ = reader.GetFile();
    header.filter_.SetFile(header.file_);
    header.path_ = path;
    return header;
  }

  [[nodiscard]] const fs::path& path() const { return path_; }

  [[nodiscard]] std::string text(std::uint16_t group, std::uint16_t element) const {
    const gdcm::Tag tag(group, element);
    const gdcm::DataSet& data =
        group == 2 ? static_cast<const gdcm::DataSet&>(file_.GetHeader()) : file_.GetDataSet();
    if (!data.FindDataElement(tag)) return {};
    return trimmed(filter_.ToString(data.GetDataElement(tag)));
  }

  /// Backslash-separated numbers; empty when the element is absent, InputError when it holds
  /// something else.
  [[nodiscard]] std::vector<double> numbers(std::uint16_t group,
                                            std::uint16_t element,
                                            const char* name) const {
    const std::string all = text(group, element);
    std::vector<double> values;
    for (std::size_t at = 0; at < all.size();) {
      const std::size_t end = std::min(all.find('\\', at), all.size());
      std::string word = trimmed(all.substr(at, end - at));
      if (word.starts_with('+')) word.erase(0, 1);
      double value = 0.0;
      const auto [rest, error] = std::from_chars(word.data(), word.data() + word.size(), value);
      if (error != std::errc() || rest != word.data() + word.size() || !std::isfinite(value))
        throw InputError(name, "'" + all + "'", "must be finite numbers", path_.string());
      values.push_back(value);
      at = end + 1;
    }
    return values;
  }

  [[nodiscard]] std::optional<double> number_or_none(std::uint16_t group,
                                                     std::uint16_t element,
                                                     const char* name) const {
    const std::vector<double> values = numbers(group, element, name);
    if (values.empty()) return std::nullopt;
    return values.front();
  }

  template <std::size_t N>
  [[nodiscard]] std::array<double, N> required(std::uint16_t group,
                                               std::uint16_t element,
                                               const char* name) const {
    const std::vector<double> values = numbers(group, element, name);
    if (values.size() != N)
      throw InputError(name,
                       values.empty() ? "(absent)" : "'" + text(group, element) + "'",
                       "a CT slice needs " + std::to_string(N) + " numbers here",
                       path_.string());
    std::array<double, N> result{};
    std::copy(values.begin(), values.end(), result.begin());
    return result;
  }

 private:
  DicomHeader() = default;
  fs::path path_;
  gdcm::File file_;
  gdcm::StringFilter filter_;
};

bool has_dicom_mark(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 132> start{};
  file.read(start.data(), start.size());
  return file.gcount() == static_cast<std::streamsize>(start.size()) &&
         std::memcmp(start.data() + 128, "DICM", 4) == 0;
}

/// Old files begin without preamble, directly with an element of group 0002 or 0008.
bool may_be_bare_dicom(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<unsigned char, 4> start{};
  file.read(reinterpret_cast<char*>(start.data()), start.size());
  return file.gcount() == 4 && (start[0] == 0x08 || start[0] == 0x02) && start[1] == 0 &&
         start[3] == 0;
}

std::vector<fs::path> files_of(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error))
    if (entry->is_regular_file()) files.push_back(entry->path());
  if (error) throw FileError(folder.string(), "cannot be listed: " + error.message());
  std::sort(files.begin(), files.end());
  return files;
}

void warn(std::vector<std::string>* warnings, const std::string& message) {
  if (warnings != nullptr) warnings->push_back(message);
}

/// "a, b, c and 9 more".
std::string some_of(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 5;
  std::string text;
  for (std::size_t i = 0; i < std::min(kShown, names.size()); ++i)
    text += (i == 0 ? "" : ", ") + names[i];
  if (names.size() > kShown) text += " and " + std::to_string(names.size() - kShown) + " more";
  return text;
}

std::vector<DicomHeader> image_headers(const fs::path& folder, std::vector<std::string>* warnings) {
  std::vector<DicomHeader> headers;
  std::vector<std::string> other_files;
  std::vector<std::string> other_objects;
  for (const fs::path& path : files_of(folder)) {
    const std::string name = path.filename().string();
    const bool marked = has_dicom_mark(path);
    if (!marked && !may_be_bare_dicom(path)) {
      other_files.push_back(name);
      continue;
    }
    std::optional<DicomHeader> header = DicomHeader::read(path);
    if (!header) {
      if (marked)
        throw FileError(path.string(), "is marked as DICOM but its header is cut short or corrupt");
      other_files.push_back(name);
      continue;
    }
    if (header->text(0x0002, 0x0002) == kMediaStorageDirectory ||
        header->text(0x0028, 0x0010).empty())
      other_objects.push_back(name);  // DICOMDIR, reports, structure sets: no rows of pixels
    else
      headers.push_back(std::move(*header));
  }
  if (!other_files.empty())
    warn(warnings, folder.string() + ": skipped, not DICOM: " + some_of(other_files));
  if (!other_objects.empty())
    warn(warnings, folder.string() + ": skipped, DICOM but no image: " + some_of(other_objects));
  if (headers.empty())
    throw FileError(folder.string(), "no DICOM image in this folder (subfolders are not searched)");
  return headers;
}

std::string describe(const DicomHeader& header) {
  std::string description = header.text(0x0008, 0x103e);
  if (description.empty()) description = "no description";
  return "'" + description + "', modality " + header.text(0x0008, 0x0060);
}

/// The files of the one series, or of the one that was chosen.
std::vector<DicomHeader> chosen_series(const fs::path& folder,
                                       std::vector<DicomHeader> headers,
                                       const std::string& series_uid) {
  std::map<std::string, std::vector<DicomHeader>> by_uid;
  for (DicomHeader& header : headers) {
    const std::string uid = header.text(0x0020, 0x000e);
    by_uid[uid].push_back(std::move(header));
  }
  if (series_uid.empty() && by_uid.size() == 1) return std::move(by_uid.begin()->second);
  if (const auto found = by_uid.find(series_uid); !series_uid.empty() && found != by_uid.end())
    return std::move(found->second);
  std::string list;
  for (const auto& [uid, files] : by_uid)
    list += "\n  " + (uid.empty() ? "(no SeriesInstanceUID)" : uid) + "  " +
            std::to_string(files.size()) + (files.size() == 1 ? " slice, " : " slices, ") +
            describe(files.front());
  if (series_uid.empty())
    throw InputError(folder.string() + ": " + std::to_string(by_uid.size()) +
                     " DICOM series in this folder; choose one with --series UID:" + list);
  throw InputError(
      "--series", series_uid, "no such series; the folder holds:" + list, folder.string());
}

/// One slice's place in the patient.
struct Slice {
  fs::path path;
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d row_direction = Eigen::Vector3d::UnitX();     ///< of increasing column index
  Eigen::Vector3d column_direction = Eigen::Vector3d::UnitY();  ///< of increasing row index
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();  ///< along columns' index, rows' index
  int columns = 0;
  int rows = 0;
  double slope = 1.0;
  double intercept = 0.0;
};

void check_is_plain_ct(const DicomHeader& header, std::vector<std::string>* warnings) {
  const std::string file = header.path().string();
  if (const std::string modality = header.text(0x0008, 0x0060); modality != "CT")
    throw InputError("Modality", "'" + modality + "'", "must be CT", file);
  if (const auto frames = header.number_or_none(0x0028, 0x0008, "NumberOfFrames");
      frames.value_or(1.0) != 1.0)
    throw InputError("NumberOfFrames",
                     number(*frames),
                     "multi-frame (enhanced) CT is not supported; convert it to NIfTI, for "
                     "example with dcm2niix",
                     file);
  if (header.number_or_none(0x0028, 0x0002, "SamplesPerPixel").value_or(1.0) != 1.0)
    throw InputError(
        "SamplesPerPixel", header.text(0x0028, 0x0002), "a CT has one value per pixel", file);
  if (const std::string meaning = header.text(0x0028, 0x0004); meaning != "MONOCHROME2")
    throw InputError("PhotometricInterpretation", "'" + meaning + "'", "must be MONOCHROME2", file);
  if (const auto tilt = header.number_or_none(0x0018, 0x1120, "GantryDetectorTilt");
      std::abs(tilt.value_or(0.0)) > kMaxGantryTiltDeg)
    throw InputError("GantryDetectorTilt",
                     number(*tilt) + " deg",
                     "tilted gantries are not supported; resample the CT to upright slices",
                     file);
  if (const std::string units = header.text(0x0028, 0x1054); !units.empty() && units != "HU")
    warn(warnings, file + ": RescaleType = '" + units + "', read as HU");
}

Slice slice_of(const DicomHeader& header) {
  const std::string file = header.path().string();
  Slice slice;
  slice.path = header.path();
  const auto position = header.required<3>(0x0020, 0x0032, "ImagePositionPatient");
  const auto cosines = header.required<6>(0x0020, 0x0037, "ImageOrientationPatient");
  const auto spacing = header.required<2>(0x0028, 0x0030, "PixelSpacing");
  slice.position_mm = Eigen::Vector3d(position[0], position[1], position[2]);
  slice.row_direction = Eigen::Vector3d(cosines[0], cosines[1], cosines[2]);
  slice.column_direction = Eigen::Vector3d(cosines[3], cosines[4], cosines[5]);
  // DICOM gives the distance between rows first.
  slice.spacing_mm = Eigen::Vector2d(spacing[1], spacing[0]);
  if (!(spacing[0] > 0.0 && spacing[1] > 0.0))
    throw InputError(
        "PixelSpacing", "'" + header.text(0x0028, 0x0030) + "'", "must be positive (mm)", file);
  if (std::abs(slice.row_direction.norm() - 1.0) > kMaxCosineError ||
      std::abs(slice.column_direction.norm() - 1.0) > kMaxCosineError ||
      std::abs(slice.row_direction.dot(slice.column_direction)) > kMaxCosineError)
    throw InputError("ImageOrientationPatient",
                     "'" + header.text(0x0020, 0x0037) + "'",
                     "must be two orthogonal unit vectors",
                     file);
  slice.rows = static_cast<int>(header.required<1>(0x0028, 0x0010, "Rows")[0]);
  slice.columns = static_cast<int>(header.required<1>(0x0028, 0x0011, "Columns")[0]);
  const auto slope = header.number_or_none(0x0028, 0x1053, "RescaleSlope");
  const auto intercept = header.number_or_none(0x0028, 0x1052, "RescaleIntercept");
  if (slope.has_value() != intercept.has_value() || slope.value_or(1.0) == 0.0)
    throw InputError("RescaleSlope, RescaleIntercept",
                     "'" + header.text(0x0028, 0x1053) + "', '" + header.text(0x0028, 0x1052) + "'",
                     "both are needed, the slope not 0",
                     file);
  slice.slope = slope.value_or(1.0);
  slice.intercept = intercept.value_or(0.0);
  return slice;
}

std::string vector_text(const Eigen::Vector3d& v) {
  return "(" + number(v.x()) + ", " + number(v.y()) + ", " + number(v.z()) + ")";
}

void check_alike(const Slice& first, const Slice& slice) {
  const std::string file = slice.path.string();
  const std::string as_first = "must be as in " + first.path.filename().string();
  if (slice.rows != first.rows || slice.columns != first.columns)
    throw InputError(
        "Columns x Rows",
        std::to_string(slice.columns) + " x " + std::to_string(slice.rows),
        as_first + ": " + std::to_string(first.columns) + " x " + std::to_string(first.rows),
        file);
  if ((slice.spacing_mm - first.spacing_mm).norm() > kMaxSpacingShare * first.spacing_mm.norm())
    throw InputError("PixelSpacing",
                     number(slice.spacing_mm.x()) + ", " + number(slice.spacing_mm.y()),
                     as_first + ": " + number(first.spacing_mm.x()) + ", " +
                         number(first.spacing_mm.y()) + " mm",
                     file);
  if ((slice.row_direction - first.row_direction).norm() > kMaxCosineDifference ||
      (slice.column_direction - first.column_direction).norm() > kMaxCosineDifference)
    throw InputError("ImageOrientationPatient",
                     vector_text(slice.row_direction) + ", " + vector_text(slice.column_direction),
                     as_first + ": " + vector_text(first.row_direction) + ", " +
                         vector_text(first.column_direction) + " (a localizer among the slices?)",
                     file);
}

/// Nearest rotation with the given in-plane axes; the third column is the slice normal.
Eigen::Matrix3d orthonormal_axes(const Slice& slice) {
  const Eigen::Vector3d normal = slice.row_direction.cross(slice.column_direction).normalized();
  const Eigen::Vector3d sum =
      (slice.row_direction.normalized() + slice.column_direction.normalized());
  const Eigen::Vector3d difference =
      (slice.row_direction.normalized() - slice.column_direction.normalized());
  // Rows and columns share what they lack of a right angle.
  const Eigen::Vector3d row = (sum.normalized() + difference.normalized()) / std::sqrt(2.0);
  Eigen::Matrix3d axes;
  axes.col(0) = row;
  axes.col(1) = normal.cross(row);
  axes.col(2) = normal;
  return axes;
}

std::string place(std::size_t slice, double height) {
  return "slice " + std::to_string(slice + 1) + " (" + number(height) + " mm)";
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Distance between slices; InputError when it is not the same everywhere. `heights` ascend.
double even_distance(const fs::path& folder,
                     const std::vector<Slice>& slices,
                     const std::vector<double>& heights) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < heights.size(); ++i) gaps.push_back(heights[i] - heights[i - 1]);
  const double usual = median(gaps);
  for (std::size_t i = 0; i < gaps.size(); ++i) {
    if (gaps[i] < kUnevenMm)
      throw InputError(folder.string() + ": two slices at one position, " +
                       place(i + 1, heights[i + 1]) +
                       " along the slice normal: " + slices[i].path.filename().string() + " and " +
                       slices[i + 1].path.filename().string());
    if (std::abs(gaps[i] - usual) > std::max(kUnevenShare * usual, kUnevenMm))
      throw InputError(
          folder.string() + ": between " + place(i, heights[i]) + " and " +
          place(i + 1, heights[i + 1]) + " the distance is " + number(gaps[i]) + " mm, elsewhere " +
          number(usual) + " mm: " +
          (gaps[i] > 1.5 * usual ? "a slice is missing" : "slices are not evenly spaced") +
          " (positions along the slice normal)");
  }
  return (heights.back() - heights.front()) / static_cast<double>(gaps.size());
}

void check_not_sheared(const fs::path& folder,
                       const std::vector<Slice>& slices,
                       const Eigen::Vector3d& normal) {
  const Eigen::Vector3d way = slices.back().position_mm - slices.front().position_mm;
  const double limit =
      std::max(kMaxDriftMm, kMaxDriftPixels * slices.front().spacing_mm.minCoeff());
  for (const Slice& slice : slices) {
    const Eigen::Vector3d from_first = slice.position_mm - slices.front().position_mm;
    const Eigen::Vector3d drift = from_first - normal * normal.dot(from_first);
    if (drift.norm() <= limit) continue;
    const double angle_deg =
        std::acos(std::clamp(std::abs(way.normalized().dot(normal)), 0.0, 1.0)) * 180.0 / M_PI;
    throw InputError(
        folder.string() + ": gantry tilt or shifted slices: " + slice.path.filename().string() +
        " lies " + number(drift.norm()) + " mm beside the line along the slice normal (limit " +
        number(limit) + " mm; the stack leans by " + number(angle_deg) +
        " deg); resample the CT to upright slices");
  }
}

CtGrid sorted_grid(const fs::path& folder, std::vector<Slice>& slices) {
  const Eigen::Matrix3d axes = orthonormal_axes(slices.front());
  const Eigen::Vector3d normal = axes.col(2);
  std::stable_sort(slices.begin(), slices.end(), [&](const Slice& a, const Slice& b) {
    return normal.dot(a.position_mm) < normal.dot(b.position_mm);
  });
  std::vector<double> heights;
  for (const Slice& slice : slices) heights.push_back(normal.dot(slice.position_mm));
  CtGrid grid;
  grid.size = {slices.front().columns, slices.front().rows, static_cast<int>(slices.size())};
  grid.spacing_mm.head<2>() = slices.front().spacing_mm;
  grid.spacing_mm.z() = even_distance(folder, slices, heights);
  check_not_sheared(folder, slices, normal);
  grid.origin_mm = slices.front().position_mm;
  grid.direction = axes;
  return grid;
}

template <typename T>
void append_rescaled(const std::vector<char>& raw, const Slice& slice, HuValues& values) {
  const std::size_t count = raw.size() / sizeof(T);
  for (std::size_t i = 0; i < count; ++i) {
    T value{};
    std::memcpy(&value, raw.data() + i * sizeof(T), sizeof(T));
    values.add(static_cast<double>(value) * slice.slope + slice.intercept);
  }
}

void append_pixels(const Slice& slice, HuValues& values) {
  const std::string file = slice.path.string();
  gdcm::ImageReader reader;
  reader.SetFileName(slice.path.c_str());
  std::vector<char> raw;
  try {
    if (!reader.Read()) throw FileError(file, "its pixels are truncated or corrupt");
    const gdcm::Image& image = reader.GetImage();
    const std::size_t expected = static_cast<std::size_t>(slice.columns) *
                                 static_cast<std::size_t>(slice.rows) *
                                 image.GetPixelFormat().GetPixelSize();
    if (image.GetBufferLength() != expected)
      throw FileError(file,
                      "pixel data",
                      std::to_string(expected) + " bytes",
                      std::to_string(image.GetBufferLength()));
    // No lossless codec packs CT noise this tightly; a header that says so lies.
    constexpr std::size_t kMaxCompression = 1000;
    if (expected / kMaxCompression > fs::file_size(slice.path))
      throw FileError(file, "truncated: the file is too small for its Rows x Columns");
    raw.resize(expected);
    if (!image.GetBuffer(raw.data())) throw FileError(file, "its pixels are truncated or corrupt");
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw FileError(file, std::string("its pixels cannot be decoded: ") + error.what());
  }
  switch (const gdcm::PixelFormat format = reader.GetImage().GetPixelFormat();
          format.GetScalarType()) {
    case gdcm::PixelFormat::UINT8:
      return append_rescaled<std::uint8_t>(raw, slice, values);
    case gdcm::PixelFormat::INT8:
      return append_rescaled<std::int8_t>(raw, slice, values);
    case gdcm::PixelFormat::UINT12:
    case gdcm::PixelFormat::UINT16:
      return append_rescaled<std::uint16_t>(raw, slice, values);
    case gdcm::PixelFormat::INT12:
    case gdcm::PixelFormat::INT16:
      return append_rescaled<std::int16_t>(raw, slice, values);
    case gdcm::PixelFormat::UINT32:
      return append_rescaled<std::uint32_t>(raw, slice, values);
    case gdcm::PixelFormat::INT32:
      return append_rescaled<std::int32_t>(raw, slice, values);
    default:
      throw InputError("pixel type",
                       format.GetScalarTypeAsString(),
                       "must be an integer of 8, 16 or 32 bits",
                       file);
  }
}

}  // namespace

bool holds_dicom(const fs::path& folder) {
  const std::vector<fs::path> files = files_of(folder);
  return std::any_of(files.begin(), files.end(), [](const fs::path& path) {
    return has_dicom_mark(path) || (may_be_bare_dicom(path) && DicomHeader::read(path));
  });
}

DicomCt read_dicom_series(const fs::path& folder,
                          const std::string& series_uid,
                          std::vector<std::string>* warnings) {
  const std::vector<DicomHeader> headers =
      chosen_series(folder, image_headers(folder, warnings), series_uid);
  std::vector<Slice> slices;
  bool rescale_missing = false;
  for (const DicomHeader& header : headers) {
    check_is_plain_ct(header, slices.empty() ? warnings : nullptr);
    rescale_missing = rescale_missing || header.text(0x0028, 0x1053).empty();
    slices.push_back(slice_of(header));
    check_alike(slices.front(), slices.back());
  }
  if (rescale_missing)
    warn(warnings, folder.string() + ": no RescaleSlope: stored values are taken as HU");
  if (slices.size() < 2)
    throw InputError(folder.string() + ": the series has one slice; a CT needs at least 2");
  DicomCt ct;
  ct.grid = sorted_grid(folder, slices);
  if (ct.grid.voxel_count() > kMaxVoxels)
    throw InputError(folder.string() + ": more than " + std::to_string(kMaxVoxels) + " voxels");
  for (const Slice& slice : slices) {
    append_pixels(slice, ct.values);
    // Only now is it known that the pixels are there which the headers promise.
    if (&slice == &slices.front()) ct.values.reserve(ct.grid.voxel_count());
  }
  return ct;
}

std::string describe_dicom_file(const fs::path& path) {
  const std::optional<DicomHeader> header = DicomHeader::read(path);
  if (!header) throw FileError(path.string(), "is marked as DICOM but its header is corrupt");
  const std::string frames = header->text(0x0028, 0x0008);
  return describe(*header) + ", " + (frames.empty() ? "1" : frames) + " frame(s)";
}

}  // namespace af
