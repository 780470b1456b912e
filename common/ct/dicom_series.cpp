// SPDX-License-Identifier: Apache-2.0
#include "ct/dicom_series.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/plausible.h"
#include "ct/slice_stack.h"
#include "images/dicom_elements.h"
#include "images/dicom_pixels.h"
#include "images/image_header.h"

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

constexpr std::string_view kMediaStorageDirectory = "1.2.840.10008.1.3.10";

std::string number(double value) {
  std::ostringstream text;
  text << value;  // six significant digits
  return text.str();
}

template <std::size_t N>
std::array<double, N> required(const DicomElements& header, DicomTag tag, const char* name) {
  const std::vector<double> values = header.numbers(tag, name);
  if (values.size() != N)
    throw InputError(name,
                     values.empty() ? "(absent)" : "'" + header.text(tag) + "'",
                     "a CT slice needs " + std::to_string(N) + " numbers here",
                     header.path().string());
  std::array<double, N> result{};
  std::copy(values.begin(), values.end(), result.begin());
  return result;
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

/// What a folder without a DICOM image holds instead.
std::string what_is_there(const std::vector<fs::path>& files,
                          const std::vector<std::string>& other_files,
                          const std::vector<std::string>& other_objects) {
  if (files.empty()) return "it holds no file";
  if (!other_objects.empty()) return "DICOM but no image: " + some_of(other_objects);
  return "not DICOM: " + some_of(other_files) + foreign_content(files.front());
}

std::vector<DicomElements> image_headers(const fs::path& folder,
                                         std::vector<std::string>* warnings) {
  std::vector<DicomElements> headers;
  std::vector<std::string> other_files;
  std::vector<std::string> other_objects;
  const std::vector<fs::path> files = files_of(folder);
  for (const fs::path& path : files) {
    const std::string name = path.filename().string();
    const bool is_marked = is_marked_dicom(path);
    if (!is_marked && !may_be_bare_dicom(path)) {
      other_files.push_back(name);
      continue;
    }
    DicomElements header = DicomElements::read(path);
    // DICOMDIR, reports and structure sets have no rows of pixels.
    if (header.text({0x0002, 0x0002}) == kMediaStorageDirectory ||
        header.text({0x0028, 0x0010}).empty())
      other_objects.push_back(name);
    else
      headers.push_back(std::move(header));
  }
  if (!other_files.empty())
    warn(warnings, folder.string() + ": skipped, not DICOM: " + some_of(other_files));
  if (!other_objects.empty())
    warn(warnings, folder.string() + ": skipped, DICOM but no image: " + some_of(other_objects));
  if (headers.empty())
    throw FileError(folder.string(),
                    "no DICOM image in this folder (subfolders are not searched): " +
                        what_is_there(files, other_files, other_objects));
  return headers;
}

std::string describe(const DicomElements& header) {
  std::string description = header.text({0x0008, 0x103e});
  if (description.empty()) description = "no description";
  return "'" + description + "', modality " + header.text({0x0008, 0x0060});
}

/// The files of the only series, or of the chosen one.
std::vector<DicomElements> chosen_series(const fs::path& folder,
                                         std::vector<DicomElements> headers,
                                         const std::string& series_uid) {
  std::map<std::string, std::vector<DicomElements>> by_uid;
  for (DicomElements& header : headers) {
    const std::string uid = header.text({0x0020, 0x000e});
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
    throw InputError(
        folder.string() + ": " + std::to_string(by_uid.size()) +
        " DICOM series in this folder; choose one with ct_series in a study, or --series UID:" +
        list);
  throw InputError(
      "--series", series_uid, "no such series; the folder holds:" + list, folder.string());
}

/// One slice's place in the patient.
struct Slice {
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d row_direction = Eigen::Vector3d::UnitX();     ///< of increasing column index
  Eigen::Vector3d column_direction = Eigen::Vector3d::UnitY();  ///< of increasing row index
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();  ///< along columns' index, rows' index
  DicomPixelLayout pixels;
};

void check_is_plain_ct(const DicomElements& header, std::vector<std::string>* warnings) {
  const std::string file = header.path().string();
  if (const std::string modality = header.text({0x0008, 0x0060}); modality != "CT")
    throw InputError("Modality", "'" + modality + "'", "must be CT", file);
  if (header.text({0x0028, 0x0004}) == "MONOCHROME1")
    warn(warnings, file + ": MONOCHROME1 says how greys are shown; HU are those of the rescale");
  if (const std::string units = header.text({0x0028, 0x1054}); !units.empty() && units != "HU")
    warn(warnings, file + ": RescaleType = '" + units + "', read as HU");
}

/// The frame of reference of the slices that state one. Throws InputError when they differ:
/// positions can only be compared within one frame.
std::string frame_of_reference(const std::vector<DicomElements>& headers) {
  std::string frame;
  for (const DicomElements& header : headers) {
    const std::string own = header.text(kDicomFrameOfReference);
    if (frame.empty()) frame = own;
    if (!own.empty() && own != frame)
      throw InputError("FrameOfReferenceUID",
                       "'" + own + "'",
                       "must be that of the series' other slices, '" + frame + "'",
                       header.path().string());
  }
  return frame;
}

Slice slice_of(const DicomElements& header) {
  const std::string file = header.path().string();
  Slice slice;
  slice.pixels = dicom_pixel_layout(header);
  const auto position = required<3>(header, {0x0020, 0x0032}, "ImagePositionPatient");
  const auto cosines = required<6>(header, {0x0020, 0x0037}, "ImageOrientationPatient");
  const auto spacing = required<2>(header, {0x0028, 0x0030}, "PixelSpacing");
  slice.position_mm = Eigen::Vector3d(position[0], position[1], position[2]);
  slice.row_direction = Eigen::Vector3d(cosines[0], cosines[1], cosines[2]);
  slice.column_direction = Eigen::Vector3d(cosines[3], cosines[4], cosines[5]);
  // DICOM gives the distance between rows first.
  slice.spacing_mm = Eigen::Vector2d(spacing[1], spacing[0]);
  if (!(spacing[0] > 0.0 && spacing[1] > 0.0))
    throw InputError(
        "PixelSpacing", "'" + header.text({0x0028, 0x0030}) + "'", "must be positive (mm)", file);
  if (std::abs(slice.row_direction.norm() - 1.0) > kMaxCosineError ||
      std::abs(slice.column_direction.norm() - 1.0) > kMaxCosineError ||
      std::abs(slice.row_direction.dot(slice.column_direction)) > kMaxCosineError)
    throw InputError("ImageOrientationPatient",
                     "'" + header.text({0x0020, 0x0037}) + "'",
                     "must be two orthogonal unit vectors",
                     file);
  return slice;
}

std::string vector_text(const Eigen::Vector3d& v) {
  return "(" + number(v.x()) + ", " + number(v.y()) + ", " + number(v.z()) + ")";
}

void check_alike(const Slice& first, const Slice& slice) {
  const std::string file = slice.pixels.path().string();
  const std::string as_first = "must be as in " + first.pixels.path().filename().string();
  if (slice.pixels.rows != first.pixels.rows || slice.pixels.columns != first.pixels.columns)
    throw InputError(
        "Columns x Rows",
        std::to_string(slice.pixels.columns) + " x " + std::to_string(slice.pixels.rows),
        as_first + ": " + std::to_string(first.pixels.columns) + " x " +
            std::to_string(first.pixels.rows),
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
  // Rows and columns share their deviation from a right angle.
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

/// The unit of the last decimal to which some numbers were rounded: 1, 0.1, ... Whatever has
/// computed with them since has left a trace of arithmetic, which must not count as decimals.
double last_decimal(const std::vector<double>& numbers) {
  constexpr int kMostDecimals = 6;
  constexpr double kArithmetic = 1e-3;
  double per_unit = 1.0;
  for (int decimals = 0; decimals < kMostDecimals; ++decimals, per_unit *= 10.0)
    if (std::ranges::all_of(numbers, [&](double number) {
          return std::abs(number * per_unit - std::round(number * per_unit)) < kArithmetic;
        }))
      break;
  return 1.0 / per_unit;
}

/// How far rounding of the slices' positions may have moved a slice against the first and the last
/// one: half of the last decimal, twice.
double position_rounding_mm(const std::vector<Slice>& slices, const Eigen::Vector3d& normal) {
  double rounding = 0.0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::vector<double> numbers;
    for (const Slice& slice : slices) numbers.push_back(slice.position_mm[axis]);
    rounding += std::abs(normal[axis]) * last_decimal(numbers);
  }
  return rounding;
}

/// Whether slices are even except for the rounding of their positions. The rounding must stay below
/// what shifts of slices are allowed, on either side. One missing slice of at least four puts
/// another one a third of the spacing or more beside the even grid, which rounding by kMostGapShare
/// of it cannot do.
bool is_even_but_rounded(const std::vector<Slice>& slices,
                         const Eigen::Vector3d& normal,
                         const std::vector<double>& heights) {
  constexpr double kMostGapShare = 0.25;
  constexpr double kArithmetic = 1e-6;
  const double spacing =
      (heights.back() - heights.front()) / static_cast<double>(heights.size() - 1);
  const double rounding = position_rounding_mm(slices, normal) + kArithmetic;
  if (rounding > std::min(2.0 * kMaxDriftMm + 2.0 * kArithmetic, kMostGapShare * spacing))
    return false;
  for (std::size_t i = 0; i < heights.size(); ++i)
    if (std::abs(heights[i] - heights.front() - static_cast<double>(i) * spacing) > rounding)
      return false;
  return true;
}

/// Why slices are not evenly spaced; empty when they are. Throws InputError for two at one
/// position. `heights` ascend.
std::string unevenness(const fs::path& folder,
                       const std::vector<Slice>& slices,
                       const std::vector<double>& heights) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < heights.size(); ++i) gaps.push_back(heights[i] - heights[i - 1]);
  const double usual = median(gaps);
  std::size_t worst = 0;
  const auto deviation = [&](std::size_t gap) { return std::abs(gaps[gap] - usual); };
  for (std::size_t i = 0; i < gaps.size(); ++i) {
    if (gaps[i] < kUnevenMm)
      throw InputError(folder.string() + ": two slices at one position, " +
                       place(i + 1, heights[i + 1]) +
                       " along the slice normal: " + slices[i].pixels.path().filename().string() +
                       " and " + slices[i + 1].pixels.path().filename().string());
    if (deviation(i) > deviation(worst)) worst = i;
  }
  if (deviation(worst) <= std::max(kUnevenShare * usual, kUnevenMm)) return {};
  return "between " + place(worst, heights[worst]) + " and " +
         place(worst + 1, heights[worst + 1]) + " the distance is " + number(gaps[worst]) +
         " mm, elsewhere " + number(usual) + " mm: " +
         (gaps[worst] > 1.5 * usual ? "a slice is missing" : "slices are not evenly spaced") +
         " (positions along the slice normal)";
}

/// Why slices do not stand straight above each other; empty when they do.
std::string leaning(const std::vector<Slice>& slices, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d way = slices.back().position_mm - slices.front().position_mm;
  const double limit =
      std::max(kMaxDriftMm, kMaxDriftPixels * slices.front().spacing_mm.minCoeff());
  for (const Slice& slice : slices) {
    const Eigen::Vector3d from_first = slice.position_mm - slices.front().position_mm;
    const Eigen::Vector3d drift = from_first - normal * normal.dot(from_first);
    if (drift.norm() <= limit) continue;
    const double angle_deg =
        std::acos(std::clamp(std::abs(way.normalized().dot(normal)), 0.0, 1.0)) * 180.0 / M_PI;
    return "gantry tilt or shifted slices: " + slice.pixels.path().filename().string() + " lies " +
           number(drift.norm()) + " mm beside the line along the slice normal (limit " +
           number(limit) + " mm; the stack leans by " + number(angle_deg) + " deg)";
  }
  return {};
}

/// Names a tag that says tilt although the slices' positions do not lean: one of the two is wrong.
std::string tilt_of_tags(const std::vector<Slice>& slices) {
  for (const Slice& slice : slices) {
    const auto tilt = slice.pixels.header.number_or_none({0x0018, 0x1120}, "GantryDetectorTilt");
    if (std::abs(tilt.value_or(0.0)) > kMaxGantryTiltDeg)
      return slice.pixels.path().string() + ": GantryDetectorTilt = " + number(*tilt) + " deg";
  }
  return {};
}

/// Slices in order, and where they lie.
struct PlacedSlices {
  SliceStack stack;
  std::string trouble;   ///< why they do not form an upright, even grid; empty when they do
  std::string rounding;  ///< what was taken for rounding of their positions; may be empty
  double largest_gap_mm = 0.0;
  double usual_gap_mm = 0.0;
};

PlacedSlices placed(const fs::path& folder, std::vector<Slice>& slices) {
  PlacedSlices found;
  SliceStack& stack = found.stack;
  stack.axes = orthonormal_axes(slices.front());
  const Eigen::Vector3d normal = stack.axes.col(2);
  std::stable_sort(slices.begin(), slices.end(), [&](const Slice& a, const Slice& b) {
    return normal.dot(a.position_mm) < normal.dot(b.position_mm);
  });
  std::vector<double> heights;
  for (const Slice& slice : slices) {
    heights.push_back(normal.dot(slice.position_mm));
    stack.origins_mm.push_back(slice.position_mm);
  }
  std::vector<double> gaps;
  for (std::size_t i = 1; i < heights.size(); ++i) gaps.push_back(heights[i] - heights[i - 1]);
  found.usual_gap_mm = median(gaps);
  found.largest_gap_mm = *std::max_element(gaps.begin(), gaps.end());
  stack.spacing_mm = slices.front().spacing_mm;
  stack.columns = slices.front().pixels.columns;
  stack.rows = slices.front().pixels.rows;
  found.trouble = unevenness(folder, slices, heights);
  if (!found.trouble.empty() && is_even_but_rounded(slices, normal, heights))
    found.rounding = std::exchange(found.trouble, {});
  if (found.trouble.empty()) found.trouble = leaning(slices, normal);
  return found;
}

/// The grid of slices as they are stored, which must be even and upright.
CtGrid stored_grid(const SliceStack& stack) {
  const Eigen::Vector3d normal = stack.axes.col(2);
  const double length = normal.dot(stack.origins_mm.back() - stack.origins_mm.front());
  CtGrid grid;
  grid.size = {stack.columns, stack.rows, static_cast<int>(stack.origins_mm.size())};
  grid.spacing_mm.head<2>() = stack.spacing_mm;
  grid.spacing_mm.z() = length / static_cast<double>(stack.origins_mm.size() - 1);
  grid.origin_mm = stack.origins_mm.front();
  grid.direction = stack.axes;
  return grid;
}

constexpr double kMostGrowth = 8.0;  ///< how many times more voxels resampling may make
constexpr double kWidestGap =
    3.5;  ///< relative to the usual gap: three slices in a row are not made up

/// The grid to resample a stack to. Throws InputError when that would be more than a small repair.
CtGrid repaired_grid(const fs::path& folder, const PlacedSlices& slices) {
  const SliceStack& stack = slices.stack;
  if (stack.columns < 2 || stack.rows < 2)
    throw InputError(folder.string() + ": slices of " + std::to_string(stack.columns) + " x " +
                     std::to_string(stack.rows) + " pixels cannot be resampled");
  if (!(slices.largest_gap_mm <= kWidestGap * slices.usual_gap_mm))
    throw InputError(folder.string() + ": " + slices.trouble + "; a gap of " +
                     number(slices.largest_gap_mm) + " mm is too wide to be resampled");
  CtGrid grid = upright_grid(stack);
  const double stored = static_cast<double>(stack.columns) * static_cast<double>(stack.rows) *
                        static_cast<double>(stack.origins_mm.size());
  const double wanted = static_cast<double>(grid.size[0]) * static_cast<double>(grid.size[1]) *
                        static_cast<double>(grid.size[2]);
  if (!(wanted <= kMostGrowth * stored))
    throw InputError(folder.string() + ": " + slices.trouble + "; its upright grid of " +
                     std::to_string(grid.size[0]) + " x " + std::to_string(grid.size[1]) + " x " +
                     std::to_string(grid.size[2]) + " voxels is too large");
  return grid;
}

/// Adds the slices' pixels to a CT. Padding becomes air, whatever its value means.
class VoxelCollector {
 public:
  explicit VoxelCollector(HuValues& values) : values_(values) {}

  void add(const DicomPixelLayout& layout) {
    constexpr double kAirHu = -1000.0;
    constexpr double kAttenuatesFromHu = -900.0;
    const DicomPixels pixels = read_dicom_pixels(layout);
    for (const double value : pixels.values)
      if (std::isnan(value))
        values_.add_hu(kAirHu);
      else
        values_.add(value);
    if (pixels.padded + pixels.doubtful > 0 && text_.empty()) text_ = layout.padding_text();
    doubtful_ += pixels.doubtful;
    const auto [low, high] = layout.padding.value_or(std::pair<std::int64_t, std::int64_t>());
    const auto is_dense = [&](std::int64_t stored) {
      return static_cast<double>(stored) * layout.slope + layout.intercept >= kAttenuatesFromHu;
    };
    if (is_dense(low) || is_dense(high)) padded_ += pixels.padded;
  }

  /// Warns of padding whose value would not have been air, and of values that are not padding after
  /// all.
  void warn_of_padding(const std::string& folder, std::vector<std::string>* warnings) const {
    if (padded_ > 0)
      warn(warnings,
           folder + ": " + std::to_string(padded_) + " voxels of " + text_ +
               " are padding and were made air");
    if (doubtful_ > 0)
      warn(warnings,
           folder + ": " + std::to_string(doubtful_) + " voxels of " + text_ +
               " away from the slices' edges are read as they are: other voxels hold lower and "
               "higher values, so this one is no mark of padding");
  }

 private:
  HuValues& values_;
  std::string text_;
  std::size_t padded_ = 0;
  std::size_t doubtful_ = 0;
};

}  // namespace

std::vector<fs::path> files_of(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error))
    if (std::error_code ignored; entry->is_regular_file(ignored)) files.push_back(entry->path());
  if (error) throw FileError(folder.string(), "cannot be listed: " + error.message());
  std::sort(files.begin(), files.end());
  return files;
}

bool holds_dicom(const fs::path& folder) {
  const std::vector<fs::path> files = files_of(folder);
  return std::any_of(files.begin(), files.end(), is_marked_dicom);
}

DicomCt read_dicom_series(const fs::path& folder,
                          const CtReadOptions& options,
                          std::vector<std::string>* warnings) {
  const std::vector<DicomElements> headers =
      chosen_series(folder, image_headers(folder, warnings), options.series_uid);
  (void)frame_of_reference(headers);
  std::vector<Slice> slices;
  bool rescale_missing = false;
  for (const DicomElements& header : headers) {
    check_is_plain_ct(header, slices.empty() ? warnings : nullptr);
    rescale_missing = rescale_missing || header.text({0x0028, 0x1053}).empty();
    slices.push_back(slice_of(header));
    check_alike(slices.front(), slices.back());
  }
  if (rescale_missing && options.values == "hu")
    warn(warnings, folder.string() + ": no RescaleSlope: stored values are taken as HU");
  if (slices.size() < 2)
    throw InputError(folder.string() + ": the series has one slice; a CT needs at least 2");
  const PlacedSlices places = placed(folder, slices);
  const std::string tag = tilt_of_tags(slices);
  if (!options.resamples && !(places.trouble.empty() && tag.empty()))
    throw InputError((places.trouble.empty() ? tag : folder.string() + ": " + places.trouble) +
                     "; resample it to an upright, even grid with --resample (ct_resample = true "
                     "in a study)");
  if (places.trouble.empty() && !tag.empty())
    warn(warnings, tag + ", but the slices' positions show no tilt; the positions are trusted");
  const bool is_repaired = !places.trouble.empty();
  if (!places.rounding.empty())
    warn(warnings,
         folder.string() + ": " + places.rounding + "; this is within the rounding of " +
             "ImagePositionPatient, so the slices are taken as even, " +
             number(stored_grid(places.stack).spacing_mm.z()) + " mm apart");
  DicomCt ct;
  ct.values = HuValues{HuConversion(options)};
  ct.grid = is_repaired ? repaired_grid(folder, places) : stored_grid(places.stack);
  if (ct.grid.voxel_count() > kMaxVoxels)
    throw InputError(folder.string() + ": more than " + std::to_string(kMaxVoxels) + " voxels");
  const std::size_t stored_voxels = stored_grid(places.stack).voxel_count();
  VoxelCollector voxels(ct.values);
  for (const Slice& slice : slices) {
    voxels.add(slice.pixels);
    // Memory is reserved only now, when the pixels that the headers promise are known to be there.
    ct.values.reserve(stored_voxels);
  }
  voxels.warn_of_padding(folder.string(), warnings);
  if (!is_repaired) return ct;
  if (ct.values.non_finite_count() + ct.values.implausible_count() > 0) {
    ct.grid = stored_grid(places.stack);  // the caller names the voxel of the file
    return ct;
  }
  ct.values.replace(resampled(places.stack, ct.values.hu(), ct.grid));
  warn(warnings,
       folder.string() + ": " + places.trouble + "; resampled to " +
           std::to_string(ct.grid.size[0]) + " x " + std::to_string(ct.grid.size[1]) + " x " +
           std::to_string(ct.grid.size[2]) + " voxels, slices " + number(ct.grid.spacing_mm.z()) +
           " mm apart");
  return ct;
}

std::string dicom_frame_of_reference(const fs::path& folder, const std::string& series_uid) {
  return frame_of_reference(chosen_series(folder, image_headers(folder, nullptr), series_uid));
}

std::string describe_dicom_file(const fs::path& path) {
  const DicomElements header = DicomElements::read(path);
  const std::string frames = header.text({0x0028, 0x0008});
  return describe(header) + ", " + (frames.empty() ? "1" : frames) + " frame(s)";
}

}  // namespace af
