// SPDX-License-Identifier: Apache-2.0
#include "ct/ct_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "base/error.h"
#include "base/plausible.h"
#include "ct/body_mask.h"
#include "ct/dicom_series.h"
#include "ct/hu_values.h"
#include "files/csv_table.h"
#include "files/input_guard.h"
#include "files/sha256.h"
#include "images/dicom_elements.h"
#include "images/image_header.h"
#include "images/stored_image.h"

namespace af {

namespace fs = std::filesystem;

namespace {

constexpr int kAirBelowHu = -900;
/// Share of bone that --body-only may remove. More means that it took the body itself for a table.
constexpr double kMostDenseRemoved = 0.1;
/// Deviation of axes from orthonormal that numbers in single precision explain.
constexpr double kDirectionRounding = 1e-6;
/// Weight of the term that settles ties between axis orders (directions at 45 degrees).
constexpr double kTieWeight = 1e-2;

std::string triple(const auto& values) {
  const auto text = [](const auto value) {
    if constexpr (std::is_floating_point_v<decltype(value)>)
      return number_text(static_cast<double>(value));
    else
      return std::to_string(value);
  };
  return "(" + text(values[0]) + ", " + text(values[1]) + ", " + text(values[2]) + ")";
}

/// Refuses anything but a scalar volume. Runs before voxels are allocated.
void check_is_scalar_volume(const RawImage& image, const fs::path& path) {
  if (image.channels != 1)
    throw InputError("channels",
                     std::to_string(image.channels),
                     "a CT has one value per voxel (RGB, vector or complex image?)",
                     path.string());
  if (const std::size_t used = image.used_axes(3); used != 3)
    throw InputError("dimensions",
                     std::to_string(used),
                     used < 3 ? "a CT is 3-D" : "a CT is 3-D; this is a series of volumes (4-D)",
                     path.string());
}

CtGrid grid_of(const RawImage& image) {
  CtGrid grid;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    grid.size[axis] = static_cast<int>(image.size[axis]);
    grid.spacing_mm[i] = image.spacing_mm[axis];
    grid.origin_mm[i] = image.origin_mm[axis];
    for (std::size_t row = 0; row < 3; ++row)
      grid.direction(static_cast<Eigen::Index>(row), i) =
          image.directions[axis][row] + 0.0;  // no -0
  }
  return grid;
}

double direction_error(const CtGrid& grid) {
  const Eigen::Matrix3d gram = grid.direction.transpose() * grid.direction;
  return (gram - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
}

/// The grid with the nearest orthonormal axes, about the same centre.
CtGrid straightened(const CtGrid& grid) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(grid.direction,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  CtGrid straight = grid;
  straight.direction = svd.matrixU() * svd.matrixV().transpose();
  straight.origin_mm += grid.center_mm() - straight.center_mm();
  return straight;
}

void add_values(ValueType type, std::span<const std::byte> bytes, HuValues& values) {
  visit_values(type, bytes, [&](const auto span) { values.add_all(span); });
}

/// Converts the voxels piece by piece while the file is read and checked, in one pass.
void read_values(const fs::path& path,
                 const ImageHeader& header,
                 HuValues& values,
                 std::vector<std::string>& warnings) {
  read_described_values(path, header, &warnings, [&](std::span<const std::byte> piece) {
    if (values.hu().empty()) values.reserve(header.image.voxel_count());
    add_values(header.image.type, piece, values);
  });
}

CtVolume read_ct_image(const fs::path& path, HuValues& values, std::vector<std::string>& warnings) {
  const std::string file = path.string();
  const std::optional<ImageFormat> format = sniff_image_format(path);
  if (!format)
    throw FileError(file,
                    "not a CT image: its content is none of NIfTI, MetaImage, NRRD" +
                        foreign_content(path) + "; a DICOM series is given as a folder");
  if (*format == ImageFormat::Dicom)
    throw InputError(file + ": a single DICOM file (" + describe_dicom_file(path) +
                     "); give the folder that holds the series" +
                     "; multi-frame CT is not supported, convert it to NIfTI");
  if (*format == ImageFormat::Png || *format == ImageFormat::Tiff)
    throw InputError(file + ": a " + std::string(format_name(*format)) +
                     " picture has no HU values and no patient frame; a CT is DICOM, NIfTI, "
                     "MetaImage or NRRD");
  const ImageHeader header = read_image_header(path, *format);
  if (!header.has_spacing)
    throw InputError("spacing", "none", "a CT's header must state it (mm)", file);
  check_is_scalar_volume(header.image, path);
  CtVolume ct;
  ct.grid = sound_grid(grid_of(header.image), file, &warnings);
  warnings.insert(warnings.end(), header.warnings.begin(), header.warnings.end());
  read_values(path, header, values, warnings);
  if (!header.has_orientation)
    warnings.push_back(file + ": no patient orientation is stored; axes are taken as LPS by " +
                       std::string(format_name(*format)) + "'s default");
  return ct;
}

std::array<std::size_t, 3> voxel_index(const CtGrid& grid, std::size_t number) {
  const auto width = static_cast<std::size_t>(grid.size[0]);
  const auto height = static_cast<std::size_t>(grid.size[1]);
  return {number % width, number / width % height, number / (width * height)};
}

void check_values(const CtGrid& grid,
                  const HuValues& values,
                  const CtReadOptions& options,
                  const std::string& file,
                  std::vector<std::string>& warnings) {
  if (values.non_finite_count() > 0)
    throw InputError(
        "voxel " + triple(voxel_index(grid, values.first_non_finite())),
        "NaN or infinite",
        "HU must be finite (" + std::to_string(values.non_finite_count()) + " such voxels)",
        file);
  if (values.implausible_count() > 0)
    throw InputError("voxel " + triple(voxel_index(grid, values.first_implausible())),
                     number_text(values.first_implausible_hu()),
                     "HU must be within 1e6 (" + std::to_string(values.implausible_count()) +
                         " voxels are beyond)",
                     file);
  // A copy instead of a reference lets the compiler vectorise the loop.
  std::int16_t low = values.hu().front();
  std::int16_t high = low;
  for (const std::int16_t hu : values.hu()) {
    low = std::min(low, hu);
    high = std::max(high, hu);
  }
  if (high < kAirBelowHu)
    throw InputError(
        "highest HU",
        std::to_string(high),
        "nothing but air: some voxel must reach " + std::to_string(kAirBelowHu) + " HU",
        file);
  if (values.clamped_count() > 0)
    warnings.push_back(file + ": " + std::to_string(values.clamped_count()) +
                       " voxels beyond int16 were clamped");
  if (options.values != "hu") return;
  const std::string range = std::to_string(low) + " to " + std::to_string(high);
  if (low >= -200)
    warnings.push_back(file + ": values " + range +
                       " do not look like HU: no voxel is near air (-1000); --values says what "
                       "else they are (ct_values in a study)");
  else if (high < 100)
    warnings.push_back(file + ": values " + range + " do not look like a CT of a body: no bone");
}

void keep_body(const CtGrid& grid,
               const std::string& file,
               std::vector<std::int16_t>& hu,
               std::vector<std::string>& warnings) {
  const BodyRemoval removal = remove_all_but_body(grid, hu);
  if (removal.dense_share_removed > kMostDenseRemoved)
    throw InputError("body_only",
                     "true",
                     "would remove " +
                         std::to_string(std::lround(100.0 * removal.dense_share_removed)) +
                         " % of what is 300 HU or more: walls of a hollow body (a dry skull?) are "
                         "too thin to be told from a table; leave this option out",
                     file);
  warnings.push_back(file + ": " + std::to_string(std::lround(removal.removed_ml)) +
                     " ml outside the body were made air (--body-only); " +
                     std::to_string(removal.parts_kept) +
                     (removal.parts_kept == 1 ? " part" : " parts") + " kept");
}

/// Permutation and signs that turn a grid's axes into ascending L, P, S.
struct AxisOrder {
  std::array<int, 3> axis = {0, 1, 2};  ///< of the grid, for L, P, S
  std::array<bool, 3> reversed = {false, false, false};
};

Eigen::Matrix3d reordered(const Eigen::Matrix3d& direction, const AxisOrder& order) {
  Eigen::Matrix3d result;
  for (std::size_t world = 0; world < 3; ++world)
    result.col(static_cast<Eigen::Index>(world)) =
        (order.reversed[world] ? -1.0 : 1.0) * direction.col(order.axis[world]);
  return result;
}

/// The order follows from where the axes point, not from their order in the file.
AxisOrder ascending_lps_order(const Eigen::Matrix3d& direction) {
  AxisOrder best;
  double best_fit = -1.0;
  AxisOrder order;
  do {
    for (std::size_t world = 0; world < 3; ++world)
      order.reversed[world] = direction(static_cast<Eigen::Index>(world), order.axis[world]) < 0.0;
    const Eigen::Matrix3d axes = reordered(direction, order);
    const double fit = axes.trace() + kTieWeight * (axes(1, 0) + axes(2, 0) + axes(2, 1));
    if (fit > best_fit) {
      best_fit = fit;
      best = order;
    }
  } while (std::next_permutation(order.axis.begin(), order.axis.end()));
  return best;
}

/// Where the axes of `order` begin, as an index of the grid.
Eigen::Vector3d first_index(const CtGrid& grid, const AxisOrder& order) {
  Eigen::Vector3d index = Eigen::Vector3d::Zero();
  for (std::size_t world = 0; world < 3; ++world)
    if (order.reversed[world])
      index[order.axis[world]] = grid.size[static_cast<std::size_t>(order.axis[world])] - 1.0;
  return index;
}

CtGrid reordered(const CtGrid& grid, const AxisOrder& order) {
  CtGrid result;
  for (std::size_t world = 0; world < 3; ++world) {
    result.size[world] = grid.size[static_cast<std::size_t>(order.axis[world])];
    result.spacing_mm[static_cast<Eigen::Index>(world)] = grid.spacing_mm[order.axis[world]];
  }
  result.origin_mm = grid.point_mm(first_index(grid, order));
  result.direction = reordered(grid.direction, order);
  return result;
}

RawImage raw_image_of(const CtVolume& ct) {
  RawImage image;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    image.size.push_back(static_cast<std::size_t>(ct.grid.size[axis]));
    image.spacing_mm.push_back(ct.grid.spacing_mm[i]);
    image.origin_mm.push_back(ct.grid.origin_mm[i]);
    const Eigen::Vector3d direction = ct.grid.direction.col(i);
    image.directions.push_back({direction.x(), direction.y(), direction.z()});
  }
  image.type = ValueType::Int16;
  const auto bytes = std::as_bytes(ct.hu.view());
  image.values.assign(bytes.begin(), bytes.end());
  return image;
}

}  // namespace

CtVolume read_ct(const fs::path& path,
                 const CtReadOptions& options,
                 std::vector<std::string>* warnings) {
  std::vector<std::string> found;
  std::error_code error;
  CtVolume ct;
  HuValues values{HuConversion(options)};
  note_input(path);
  if (fs::is_directory(path, error)) {
    DicomCt series = read_dicom_series(path, options, &found);
    ct.grid = series.grid;
    values = std::move(series.values);
    ct.grid = sound_grid(ct.grid, path.string(), &found);
  } else {
    ct = read_ct_image(path, values, found);
  }
  check_values(ct.grid, values, options, path.string(), found);
  std::vector<std::int16_t> hu = values.take();
  if (options.keeps_body_only) keep_body(ct.grid, path.string(), hu, found);
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  if (warnings != nullptr) warnings->insert(warnings->end(), found.begin(), found.end());
  return ct;
}

std::string ct_frame_of_reference(const fs::path& path, const CtReadOptions& options) {
  std::error_code error;
  if (fs::is_directory(path, error)) return dicom_frame_of_reference(path, options.series_uid);
  return is_marked_dicom(path) ? DicomElements::read(path).text(kDicomFrameOfReference)
                               : std::string();
}

CtGrid sound_grid(const CtGrid& grid, const std::string& file, std::vector<std::string>* warnings) {
  std::vector<std::string> problems;
  const auto extent = [&](std::size_t axis) { return static_cast<std::uint64_t>(grid.size[axis]); };
  if (std::ranges::min(grid.size) < 2)
    problems.push_back("size = " + triple(grid.size) + ": must be at least 2 voxels on each axis");
  else if (kMaxVoxels / extent(0) / extent(1) < extent(2))  // their product could wrap
    problems.push_back("size = " + triple(grid.size) + ": must be at most " +
                       std::to_string(kMaxVoxels) + " voxels");
  if (!std::all_of(grid.spacing_mm.begin(), grid.spacing_mm.end(), is_plausible_spacing_mm))
    problems.push_back("spacing = " + triple(grid.spacing_mm) + " mm: " + kPlausibleSpacing);
  if (!(grid.origin_mm.cwiseAbs().maxCoeff() <= kMaxCtOriginMm))
    problems.push_back("origin = " + triple(grid.origin_mm) +
                       " mm: must be finite and within 1e4 mm (10 m)");
  if (!(direction_error(grid) <= kMaxDirectionError))
    problems.push_back("direction columns " + triple(grid.direction.col(0)) + ", " +
                       triple(grid.direction.col(1)) + ", " + triple(grid.direction.col(2)) +
                       ": must be orthonormal (a sheared or scaled grid is not supported; resample "
                       "the CT)");
  throw_if_any(problems, file);
  if (direction_error(grid) <= kDirectionRounding) return grid;
  const CtGrid straight = straightened(grid);
  const double shift_mm = largest_corner_shift_mm(grid, straight);
  if (shift_mm > kSamePlaceMm && warnings != nullptr)
    warnings->push_back(file +
                        ": its axes are not quite orthonormal; the nearest that are place its "
                        "corners up to " +
                        number_text(std::round(shift_mm * 1e3) / 1e3) +
                        " mm from where the file does");
  return straight;
}

void write_ct(const CtVolume& ct, const fs::path& path) {
  const std::string name = path.filename().string();
  if (!name.ends_with(".mha") && !name.ends_with(".nii.gz") && !name.ends_with(".nrrd"))
    throw UsageError(path.string() + ": a CT is written as .mha, .nii.gz or .nrrd");
  write_raw_image(raw_image_of(ct), path);
}

CtIdentity identity_of(const CtVolume& ct) {
  const AxisOrder order = ascending_lps_order(ct.grid.direction);
  const CtGrid grid = reordered(ct.grid, order);
  const std::array<int, 3>& size = grid.size;
  const std::array<std::ptrdiff_t, 3> stride = {
      1, ct.grid.size[0], std::ptrdiff_t{ct.grid.size[0]} * ct.grid.size[1]};
  std::array<std::ptrdiff_t, 3> step{};
  std::ptrdiff_t first = 0;
  for (std::size_t world = 0; world < 3; ++world) {
    const auto from = static_cast<std::size_t>(order.axis[world]);
    step[world] = order.reversed[world] ? -stride[from] : stride[from];
    if (order.reversed[world]) first += stride[from] * (size[world] - 1);
  }
  static_assert(std::endian::native == std::endian::little, "numbers are hashed low byte first");
  Sha256 hash;
  hash.update(std::as_bytes(std::span(size)));
  std::vector<std::int16_t> slice(static_cast<std::size_t>(size[0]) *
                                  static_cast<std::size_t>(size[1]));
  const std::int16_t* hu = ct.hu.data();
  for (int k = 0; k < size[2]; ++k) {
    auto to = slice.begin();
    for (int j = 0; j < size[1]; ++j) {
      const std::int16_t* row = hu + first + k * step[2] + j * step[1];
      for (int i = 0; i < size[0]; ++i) *to++ = row[i * step[0]];
    }
    hash.update(std::as_bytes(std::span(slice)));
  }
  return {hash.hex_digest(), grid};
}

}  // namespace af
