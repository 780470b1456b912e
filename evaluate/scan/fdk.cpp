// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/fdk.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/plausible.h"
#include "ct/attenuation_volume.h"
#include "evaluate/scan/image_sampling.h"
#include "geometry/point_projector.h"

namespace af {

namespace {

/// Samples of the plane through the axis, along the tangent and along the axis, mm. A line of
/// constant tangent coordinate is contiguous, because back projection walks along the axis.
struct AxisPlane {
  int tangents = 0;
  int heights = 0;
  double pitch_mm = 0.0;
  [[nodiscard]] double tangent_mm(int i) const { return (i - 0.5 * (tangents - 1)) * pitch_mm; }
  [[nodiscard]] double height_mm(int i) const { return (i - 0.5 * (heights - 1)) * pitch_mm; }
};

/// A displaced detector sees only one side of the object, and half a turn later the other.
class DetectorDisplacement {
 public:
  explicit DetectorDisplacement(const CircularScan& scan) : radius_mm_(scan.source_to_axis_mm) {
    constexpr double kMargin = 0.02;  // the beam need not meet the detector where it is stated to
    const AxisView view = view_at_axis(scan);
    is_displaced_ = is_displaced(view);
    narrow_sign_ = view.is_narrow_before ? -1.0 : 1.0;
    overlap_mm_ = view.narrow_mm - kMargin * (view.narrow_mm + view.wide_mm);
    reach_mm_ = is_displaced_ ? view.wide_mm : view.narrow_mm;
  }

  /// Radius of the cylinder that the full circle sees. A ray that just misses the detector passes
  /// the axis at this distance.
  [[nodiscard]] double seen_radius_mm() const {
    return radius_mm_ * std::sin(std::atan(reach_mm_ / radius_mm_));
  }

  /// The weight of a ray. It and the opposite ray have 2 together (G. Wang, Med. Phys. 29:1634,
  /// 2002). The weight is smooth, so that the sum is too, although often only one of the two is
  /// measured.
  [[nodiscard]] double weight(double across_mm) const {
    if (!is_displaced_) return 1.0;
    const double to_narrow = narrow_sign_ * across_mm;
    if (to_narrow >= overlap_mm_) return 0.0;
    if (to_narrow <= -overlap_mm_) return 2.0;
    const double share = std::atan(to_narrow / radius_mm_) / std::atan(overlap_mm_ / radius_mm_);
    return 1.0 - std::sin(0.5 * std::numbers::pi * share);
  }

 private:
  double radius_mm_;
  bool is_displaced_ = false;
  double narrow_sign_ = 1.0;
  double overlap_mm_ = 0.0;
  double reach_mm_ = 0.0;
};

double axis_pixel_mm(const CircularScan& scan) {
  return scan.pixel_spacing_mm.minCoeff() * scan.source_to_axis_mm / scan.source_to_detector_mm;
}

/// Whether the object reaches beyond the detector: the ends of the lines across the axis attenuate.
bool is_truncated(const CircularScan& scan, std::span<const ScanView> views) {
  constexpr double kLeastShare = 0.1;  // share of the mean attenuation
  const bool lines_are_columns = scan.axis_along == AxisAlong::Columns;
  double ends = 0.0;
  double all = 0.0;
  for (const ScanView& view : views) {
    const Image2d& image = *view.line_integrals;
    double of_view = 0.0;
    for (const float value : image.pixels) of_view += static_cast<double>(value);
    all += of_view / static_cast<double>(image.pixels.size());
    const int lines = lines_are_columns ? image.width : image.height;
    const int last = (lines_are_columns ? image.height : image.width) - 1;
    double of_ends = 0.0;
    for (int line = 0; line < lines; ++line)
      for (const int at : {0, last})
        of_ends += static_cast<double>(lines_are_columns ? image.at(line, at) : image.at(at, line));
    ends += of_ends / (2.0 * lines);
  }
  return ends > kLeastShare * all;
}

/// Width of the plane relative to what the detector sees. The beam need not meet the detector where
/// it is stated to, and a truncated object continues beside it.
constexpr double kMargin = 1.1;
constexpr double kTruncatedMargin = 1.6;

AxisPlane axis_plane(const CircularScan& scan, double margin) {
  AxisPlane plane;
  plane.pitch_mm = axis_pixel_mm(scan);
  const AxisView view = view_at_axis(scan);
  const double half_height = std::max(-view.lowest_mm, view.highest_mm);
  plane.tangents = 2 * static_cast<int>(std::ceil(margin * view.wide_mm / plane.pitch_mm)) + 1;
  plane.heights = 2 * static_cast<int>(std::ceil(kMargin * half_height / plane.pitch_mm)) + 1;
  return plane;
}

/// The ramp filter as a kernel in space for the plane's samples along a tangent (Kak and Slaney,
/// 3.3.3), smoothed by a Gaussian; entry i is the weight at distance i samples.
std::vector<float> ramp_kernel(const AxisPlane& plane, double smoothing_px) {
  const auto ramp = [&](int n) {
    if (n == 0) return 0.25;
    if (n % 2 == 0) return 0.0;
    return -1.0 / (std::numbers::pi * std::numbers::pi * n * n);
  };
  const int radius = smoothing_px > 0.0 ? static_cast<int>(std::ceil(4.0 * smoothing_px)) : 0;
  std::vector<double> gauss;
  double sum = 0.0;
  for (int i = -radius; i <= radius; ++i) {
    gauss.push_back(radius == 0 ? 1.0 : std::exp(-0.5 * i * i / (smoothing_px * smoothing_px)));
    sum += gauss.back();
  }
  std::vector<float> kernel(static_cast<std::size_t>(plane.tangents));
  for (int n = 0; n < plane.tangents; ++n) {
    double value = 0.0;
    int at = n + radius;
    for (const double weight : gauss) value += weight * ramp(at--);
    // 1 / pitch^2 of the kernel times the pitch of the sum.
    kernel[static_cast<std::size_t>(n)] = static_cast<float>(value / (sum * plane.pitch_mm));
  }
  return kernel;
}

/// Beside the detector, an object is assumed to continue as at the detector's edge, and to end
/// softly within a quarter of the detector's width. An abrupt end at the edge would be the
/// brightest part of the filtered line.
double beyond_edge_weight(double position_px, int size_px) {
  constexpr double kShare = 0.25;
  const double beyond = std::max(-position_px, position_px - (size_px - 1));
  if (beyond <= 0.0) return 1.0;
  const double share = beyond / (kShare * size_px);
  return share >= 1.0 ? 0.0 : std::pow(std::cos(0.5 * std::numbers::pi * share), 2);
}

/// The cosine-weighted image on the axis plane, one line of tangents after the other.
std::vector<float> weighted_lines(const CircularScan& scan,
                                  const ScanView& view,
                                  const AxisPlane& plane) {
  const PointProjector projector(view.camera);
  const Eigen::Vector3d tangent(std::cos(view.angle_rad), std::sin(view.angle_rad), 0.0);
  const double radius = scan.source_to_axis_mm;
  const DetectorDisplacement displacement(scan);
  const int across_axis = scan.axis_along == AxisAlong::Columns ? 1 : 0;
  std::vector<float> lines(static_cast<std::size_t>(plane.heights) *
                           static_cast<std::size_t>(plane.tangents));
  float* next = lines.data();
  for (int h = 0; h < plane.heights; ++h)
    for (int t = 0; t < plane.tangents; ++t) {
      const double across = plane.tangent_mm(t);
      const double along = plane.height_mm(h);
      const Eigen::Vector2d pixel =
          projector.project(across * tangent + along * Eigen::Vector3d::UnitZ());
      const double cosine = radius / std::sqrt(radius * radius + across * across + along * along);
      const double weight = cosine * displacement.weight(across) *
                            beyond_edge_weight(pixel[across_axis], scan.size_px[across_axis]);
      *next++ =
          static_cast<float>(weight * sampled_cubic(*view.line_integrals, pixel.x(), pixel.y()));
    }
  return lines;
}

/// Convolves each line and stores it across, so that values of one tangent are contiguous.
std::vector<float> filtered_columns(const std::vector<float>& lines,
                                    const AxisPlane& plane,
                                    const std::vector<float>& kernel) {
  const auto tangents = static_cast<std::size_t>(plane.tangents);
  const auto heights = static_cast<std::size_t>(plane.heights);
  // weights[c + n] is the weight at distance n, so that the sums below run over contiguous arrays.
  std::vector<float> weights(2 * tangents - 1);
  for (std::size_t n = 0; n < tangents; ++n)
    weights[tangents - 1 + n] = weights[tangents - 1 - n] = kernel[n];
  std::vector<float> columns(tangents * heights);
  std::vector<float> filtered(tangents);
  for (std::size_t h = 0; h < heights; ++h) {
    const float* const line = lines.data() + h * tangents;
    std::fill(filtered.begin(), filtered.end(), 0.0F);
    for (std::size_t from = 0; from < tangents; ++from) {
      const float value = line[from];
      if (value == 0.0F) continue;
      const float* const weight = weights.data() + (tangents - 1 - from);
      for (std::size_t to = 0; to < tangents; ++to) filtered[to] += value * weight[to];
    }
    for (std::size_t t = 0; t < tangents; ++t) columns[t * heights + h] = filtered[t];
  }
  return columns;
}

/// What back projection needs of one view.
struct FilteredView {
  double cosine = 1.0;
  double sine = 0.0;
  double weight = 0.0;  ///< share of the circle / 2, times the square of the circle's radius
  std::vector<float> columns;
};

/// Adds one view to the voxels of one (i, j), which lie along the axis.
void add_to_column(const FilteredView& view,
                   const AxisPlane& plane,
                   const CtGrid& grid,
                   double radius_mm,
                   double x,
                   double y,
                   std::span<float> column) {
  const double depth = radius_mm - x * view.sine + y * view.cosine;
  const double across = radius_mm * (x * view.cosine + y * view.sine) / depth;
  const double t = across / plane.pitch_mm + 0.5 * (plane.tangents - 1);
  const int t0 = std::clamp(static_cast<int>(std::floor(t)), 0, plane.tangents - 2);
  const auto along_t = static_cast<float>(std::clamp(t - t0, 0.0, 1.0));
  const float* const left =
      view.columns.data() + static_cast<std::size_t>(t0) * static_cast<std::size_t>(plane.heights);
  const float* const right = left + plane.heights;
  const auto weight = static_cast<float>(view.weight / (depth * depth));
  const float left_weight = weight * (1.0F - along_t);
  const float right_weight = weight * along_t;
  const double scale = radius_mm / (depth * plane.pitch_mm);
  const auto first = static_cast<float>(grid.origin_mm.z() * scale + 0.5 * (plane.heights - 1));
  const auto step = static_cast<float>(grid.spacing_mm.z() * scale);
  const auto last = static_cast<float>(plane.heights - 1) - 1e-3F;
  for (std::size_t k = 0; k < column.size(); ++k) {
    const float h = std::clamp(first + step * static_cast<float>(k), 0.0F, last);
    const auto h0 = static_cast<int>(h);
    const float along_h = h - static_cast<float>(h0);
    const float low = left_weight * left[h0] + right_weight * right[h0];
    const float high = left_weight * left[h0 + 1] + right_weight * right[h0 + 1];
    column[k] += low + along_h * (high - low);
  }
}

}  // namespace

void FdkOptions::describe(Fields& field) {
  field("voxel_mm", voxel_mm, "Voxel of the reconstructed CT, mm; 0: a detector pixel at the axis")
      .within(0.0, kMaxSpacingMm);
  field("smoothing_px",
        smoothing_px,
        "Standard deviation of a Gaussian that smooths the filtered lines, detector pixels")
      .within(0.0, 20.0);
}

CtGrid scan_grid(const CircularScan& scan, double voxel_mm) {
  const double voxel = voxel_mm > 0.0 ? voxel_mm : axis_pixel_mm(scan);
  const AxisView view = view_at_axis(scan);
  const double radius = DetectorDisplacement(scan).seen_radius_mm();
  CtGrid grid;
  const auto voxels = [&](double width_mm) {
    return std::max(2, static_cast<int>(std::floor(width_mm / voxel)));
  };
  grid.size = {
      voxels(2.0 * radius), voxels(2.0 * radius), voxels(view.highest_mm - view.lowest_mm)};
  grid.spacing_mm.setConstant(voxel);
  for (Eigen::Index axis = 0; axis < 3; ++axis)
    grid.origin_mm[axis] = -0.5 * (grid.size[static_cast<std::size_t>(axis)] - 1) * voxel;
  grid.origin_mm.z() += 0.5 * (view.highest_mm + view.lowest_mm);
  return grid;
}

MuVolume reconstruct_fdk(const CircularScan& scan,
                         std::span<const ScanView> views,
                         const CtGrid& grid,
                         const FdkOptions& options,
                         ThreadPool& pool) {
  check(grid.direction.isIdentity(), "FDK wants the grid's axes to be those of the scan");
  std::vector<double> angles;
  for (const ScanView& view : views) angles.push_back(view.angle_rad);
  const std::vector<double> shares = angle_shares_rad(angles);
  const AxisPlane plane = axis_plane(scan, is_truncated(scan, views) ? kTruncatedMargin : kMargin);
  const std::vector<float> kernel = ramp_kernel(plane, options.smoothing_px);
  const double radius = scan.source_to_axis_mm;

  std::vector<FilteredView> filtered(views.size());
  pool.for_each(static_cast<int>(views.size()), [&](int task, int /*slot*/) {
    const auto i = static_cast<std::size_t>(task);
    filtered[i] = {std::cos(views[i].angle_rad),
                   std::sin(views[i].angle_rad),
                   0.5 * shares[i] * radius * radius,
                   filtered_columns(weighted_lines(scan, views[i], plane), plane, kernel)};
  });

  MuVolume volume{grid, std::vector<float>(grid.voxel_count())};
  const auto ni = static_cast<std::size_t>(grid.size[0]);
  const auto nj = static_cast<std::size_t>(grid.size[1]);
  const auto nk = static_cast<std::size_t>(grid.size[2]);
  const double seen_radius = DetectorDisplacement(scan).seen_radius_mm();
  pool.for_each(grid.size[1], [&](int j, int /*slot*/) {
    const double y = grid.origin_mm.y() + j * grid.spacing_mm.y();
    std::vector<float> column(nk);
    for (std::size_t i = 0; i < ni; ++i) {
      const double x = grid.origin_mm.x() + static_cast<double>(i) * grid.spacing_mm.x();
      if (std::hypot(x, y) > seen_radius) continue;
      std::fill(column.begin(), column.end(), 0.0F);
      for (const FilteredView& view : filtered)
        add_to_column(view, plane, grid, radius, x, y, column);
      for (std::size_t k = 0; k < nk; ++k)
        volume.mu_per_mm[(k * nj + static_cast<std::size_t>(j)) * ni + i] = column[k];
    }
  });
  return volume;
}

CtVolume ct_of(const MuVolume& volume, double mu_water_per_mm) {
  std::vector<std::int16_t> hu(volume.mu_per_mm.size());
  for (std::size_t i = 0; i < hu.size(); ++i) {
    const double value =
        1000.0 * (static_cast<double>(volume.mu_per_mm[i]) / mu_water_per_mm - 1.0);
    hu[i] = static_cast<std::int16_t>(std::lround(std::clamp(value, -32768.0, 32767.0)));
  }
  return {volume.grid, SharedArray<std::int16_t>(std::move(hu))};
}

double reference_mu_per_mm(const MuVolume& volume) {
  std::vector<float> inside;
  for (const float mu : volume.mu_per_mm)
    if (mu != 0.0F) inside.push_back(mu);
  if (inside.empty()) throw InputError("the reconstruction is empty: no view attenuates");
  const auto at = inside.begin() + static_cast<std::ptrdiff_t>(inside.size() * 199 / 200);
  std::nth_element(inside.begin(), at, inside.end());
  if (!(*at > 0.0F)) throw InputError("the reconstruction is empty: no view attenuates");
  return 0.5 * static_cast<double>(*at);
}

double light_share(const MuVolume& volume, double cut_mu_per_mm) {
  double light = 0.0;
  double all = 0.0;
  for (const float mu : volume.mu_per_mm) {
    const auto value = static_cast<double>(mu);
    if (value < cut_mu_per_mm) light += value;
    all += value;
  }
  return all > 0.0 ? std::max(0.0, light) / all : 0.0;
}

double registration_water_mu_per_mm(const MuVolume& volume) {
  constexpr double kMostLight = 0.05;
  constexpr double kAirOfWater = 1.0 + AttenuationModel{}.air_below_hu / 1000.0;
  constexpr double kMostOfWater = 33.0;  // of 16-bit HU
  const double densest =
      static_cast<double>(*std::max_element(volume.mu_per_mm.begin(), volume.mu_per_mm.end()));
  double water = reference_mu_per_mm(volume);
  while (light_share(volume, kAirOfWater * water) > kMostLight &&
         0.5 * water * kMostOfWater > densest)
    water *= 0.5;
  return water;
}

}  // namespace af
