// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/scan_geometry.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <tuple>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/plausible.h"
#include "geometry/rigid_transform.h"

namespace af {

namespace {

constexpr int kFewestPixels = 16;  ///< on each side of the detector
constexpr double kTurn = 2.0 * std::numbers::pi;

Eigen::Matrix3d turned_about(const Eigen::Vector3d& axis, double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
}

/// Angles within one turn, ascending, as indices.
std::vector<std::size_t> order_around(const std::vector<double>& within_turn) {
  std::vector<std::size_t> order(within_turn.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return within_turn[a] < within_turn[b];
  });
  return order;
}

/// The gap from each angle to the next one around the circle, in the order of order_around().
std::vector<double> gaps_around(const std::vector<double>& within_turn,
                                const std::vector<std::size_t>& order) {
  std::vector<double> gaps(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_last = i + 1 == order.size();
    const double next = within_turn[order[is_last ? 0 : i + 1]] + (is_last ? kTurn : 0.0);
    gaps[i] = next - within_turn[order[i]];
  }
  return gaps;
}

std::vector<double> within_one_turn(std::vector<double> angles_rad) {
  for (double& angle : angles_rad) angle -= kTurn * std::floor(angle / kTurn);
  return angles_rad;
}

std::string out_of_range(const std::string& name, double value, const std::string& constraint) {
  return name + " = " + std::to_string(value) + ": " + constraint;
}

/// "the views leave 40 degrees of the circle empty, ..." when they do not cover the whole circle.
void note_gaps(const std::vector<double>& angles_rad,
               const std::string& which,
               std::vector<std::string>& found) {
  constexpr double kMostUneven = 3.0;
  constexpr double kAnyGapRad =
      30.0 * kRadPerDeg;  // beyond this, some views are missing, or all are sparse
  const std::vector<double> within_turn = within_one_turn(angles_rad);
  std::vector<double> gaps = gaps_around(within_turn, order_around(within_turn));
  std::sort(gaps.begin(), gaps.end());
  const double even_gap = kTurn / static_cast<double>(gaps.size());
  // Repeated angles leave wider gaps between the others.
  const double typical = std::max(gaps[gaps.size() / 2], even_gap);
  if (gaps.back() > std::max(kAnyGapRad, kMostUneven * typical))
    found.push_back(which + " leave " + std::to_string(gaps.back() * kDegPerRad) +
                    " degrees of the circle empty, where neighbours are " +
                    std::to_string(typical * kDegPerRad) + " degrees apart: ");
}

void note_angle_problems(const std::vector<double>& angles_rad, std::vector<std::string>& found) {
  constexpr std::size_t kFewestViews = 16;
  if (angles_rad.size() < kFewestViews) {
    found.push_back("views = " + std::to_string(angles_rad.size()) + ": must be at least " +
                    std::to_string(kFewestViews));
    return;
  }
  std::vector<std::string> gaps;
  note_gaps(angles_rad, "the views", gaps);
  if (!gaps.empty()) {
    found.push_back(gaps.front() + "the scan must go all the way round");
    return;
  }
  // The even views are reconstructed, and so is each half of them.
  for (const auto& [first, stride, which] :
       {std::tuple{0, 2, "the even views"},
        std::tuple{0, 4, "every fourth view from the first"},
        std::tuple{2, 4, "every fourth view from the third"}}) {
    std::vector<double> part;
    for (const int view : CircularScan::every(first, stride, static_cast<int>(angles_rad.size())))
      part.push_back(angles_rad[static_cast<std::size_t>(view)]);
    note_gaps(part, which, gaps);
    if (gaps.empty()) continue;
    found.push_back(gaps.front() + "list the views in the order of their angles");
    return;
  }
}

}  // namespace

std::vector<int> CircularScan::every(int first, int stride, int end) {
  std::vector<int> views;
  for (int view = first; view < end; view += stride) views.push_back(view);
  return views;
}

CircularScan CircularScan::binned(int factor) const {
  CircularScan result = *this;
  result.pixel_spacing_mm *= factor;
  result.size_px /= factor;
  if (result.size_px.minCoeff() < kFewestPixels)
    throw InputError("size_px",
                     std::to_string(size_px.x()) + " x " + std::to_string(size_px.y()),
                     "must keep at least " + std::to_string(kFewestPixels) +
                         " pixels on both sides when binned by " + std::to_string(factor));
  // Pixel centres are integers, and the outer edge, at -1/2, stays.
  if (result.beam_foot_px)
    result.beam_foot_px = (result.beam_foot_px->array() + 0.5) / factor - 0.5;
  return result;
}

CircularScan CircularScan::enlarged(double factor) const {
  CircularScan result = *this;
  result.source_to_axis_mm *= factor;
  result.source_to_detector_mm *= factor;
  result.pixel_spacing_mm *= factor;
  return result;
}

Eigen::Vector2d CircularScan::stated_foot_px() const {
  return beam_foot_px.value_or(0.5 * (size_px.cast<double>().array() - 1.0).matrix());
}

AxisView view_at_axis(const CircularScan& scan) {
  const double scale = scan.source_to_axis_mm / scan.source_to_detector_mm;
  const Eigen::Vector2d pixel_mm = scale * scan.pixel_spacing_mm;
  // From the foot to the outer edges of the first, and of the last column and row.
  const Eigen::Vector2d before =
      pixel_mm.cwiseProduct((scan.stated_foot_px().array() + 0.5).matrix());
  const Eigen::Vector2d behind = pixel_mm.cwiseProduct(scan.size_px.cast<double>()) - before;
  const bool along_columns = scan.axis_along == AxisAlong::Columns;
  const int across = along_columns ? 1 : 0;
  AxisView view;
  view.lowest_mm = along_columns ? -before.x() : -behind.y();
  view.highest_mm = along_columns ? behind.x() : before.y();
  view.narrow_mm = std::min(before[across], behind[across]);
  view.wide_mm = std::max(before[across], behind[across]);
  view.is_narrow_before = before[across] < behind[across];
  return view;
}

bool is_displaced(const AxisView& view) {
  constexpr double kMostShare = 0.7;
  return view.narrow_mm < kMostShare * view.wide_mm;
}

int room_for_registration(const CircularScan& scan) {
  constexpr double kLeastAcrossMm = 60.0;
  constexpr double kLeastToAxisMm = 200.0;
  const AxisView view = view_at_axis(scan);
  const double wanted = std::max(kLeastAcrossMm / (view.narrow_mm + view.wide_mm),
                                 kLeastToAxisMm / scan.source_to_axis_mm);
  return std::max(1, static_cast<int>(std::ceil(wanted)));
}

std::vector<std::string> problems(const CircularScan& scan) {
  std::vector<std::string> found;
  const auto is_length = [](double mm) { return mm > 0.0 && mm <= kMaxRoomMm; };
  if (!is_length(scan.source_to_axis_mm))
    found.push_back(out_of_range(
        "source_to_axis_mm", scan.source_to_axis_mm, "must be above 0, at most 1e6 mm"));
  if (!(scan.source_to_detector_mm > scan.source_to_axis_mm) ||
      !is_length(scan.source_to_detector_mm))
    found.push_back(out_of_range("source to detector",
                                 scan.source_to_detector_mm,
                                 "must be above source_to_axis_mm, at most 1e6 mm"));
  for (const double spacing : scan.pixel_spacing_mm)
    if (!is_plausible_spacing_mm(spacing))
      found.push_back(out_of_range("pixel_spacing_mm", spacing, kPlausibleSpacing));
  constexpr int kMostPixels = 16384;
  for (const int size : scan.size_px)
    if (size < kFewestPixels || size > kMostPixels)
      found.push_back("size_px = " + std::to_string(size) + ": must be between 16 and 16384");
  for (int axis = 0; axis < 2; ++axis) {
    const double foot = scan.stated_foot_px()[axis];
    // The whole object must be seen on both sides of the axis.
    if (!(foot > 0.0) || !(foot < scan.size_px[axis] - 1))
      found.push_back(out_of_range("beam_foot_px", foot, "must be on the detector"));
  }
  for (const double angle : scan.angles_rad)
    if (!std::isfinite(angle)) return {"angles must be finite"};
  note_angle_problems(scan.angles_rad, found);
  return found;
}

std::vector<double> angle_shares_rad(const std::vector<double>& angles_rad) {
  const std::vector<double> within_turn = within_one_turn(angles_rad);
  const std::vector<std::size_t> order = order_around(within_turn);
  const std::vector<double> gaps = gaps_around(within_turn, order);
  std::vector<double> shares(angles_rad.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const double before = gaps[i == 0 ? order.size() - 1 : i - 1];
    shares[order[i]] = 0.5 * (before + gaps[i]);
  }
  return shares;
}

std::optional<std::vector<double>> continued_rad(const std::vector<double>& angles_rad) {
  std::vector<double> continued = angles_rad;
  double forward = 0.0;
  double backward = 0.0;
  for (std::size_t i = 1; i < angles_rad.size(); ++i) {
    const double step = std::remainder(angles_rad[i] - angles_rad[i - 1], kTurn);
    constexpr double kMostStep = 0.25 * kTurn;
    if (std::abs(step) > kMostStep) return std::nullopt;
    (step < 0.0 ? backward : forward) += std::abs(step);
    continued[i] = continued[i - 1] + step;
  }
  constexpr double kMostBack = 0.01;
  if (std::min(forward, backward) > kMostBack * (forward + backward)) return std::nullopt;
  return continued;
}

std::optional<Sweep> sweep_of(const CircularScan& scan) {
  const std::optional<std::vector<double>> continued = continued_rad(scan.angles_rad);
  const auto is_same = [](double a, double b) {
    constexpr double kRounding = 1e-6;
    return std::abs(a - b) < kRounding;
  };
  if (!continued || continued->empty() || is_same(continued->front(), continued->back()) ||
      !std::equal(continued->begin(), continued->end(), scan.angles_rad.begin(), is_same))
    return std::nullopt;
  return Sweep{continued->front(), continued->back()};
}

Eigen::VectorXd AngleBasis::at(double angle_rad) const {
  Eigen::VectorXd values(size());
  values[0] = 1.0;
  for (Eigen::Index k = 1; k <= harmonics; ++k) {
    const double angle = static_cast<double>(k) * angle_rad;
    values[2 * k - 1] = std::cos(angle);
    values[2 * k] = std::sin(angle);
  }
  if (drift)
    values[size() - 1] =
        (angle_rad - drift->first_rad) / (drift->last_rad - drift->first_rad) - 0.5;
  return values;
}

ScanCalibration ScanCalibration::nominal(const CircularScan& scan, const AngleBasis& basis) {
  ScanCalibration calibration;
  calibration.source_to_detector_mm = scan.source_to_detector_mm;
  calibration.column_px = AngleSeries(basis);
  calibration.row_px = AngleSeries(basis);
  calibration.rotation_rad = AngleSeries(basis);
  calibration.column_px.coefficients[0] = scan.stated_foot_px().x();
  calibration.row_px.coefficients[0] = scan.stated_foot_px().y();
  return calibration;
}

ScanCalibration ScanCalibration::binned(double factor) const {
  ScanCalibration result = *this;
  for (AngleSeries* const series : {&result.column_px, &result.row_px}) {
    series->coefficients /= factor;
    // Pixel centres are integers, and the outer edge, at -1/2, stays.
    series->coefficients[0] += 0.5 / factor - 0.5;
  }
  return result;
}

CameraGeometry scan_camera(const CircularScan& scan,
                           const ScanCalibration& calibration,
                           double angle_rad,
                           const std::string& name) {
  const double rotation = calibration.rotation_rad.at(angle_rad);
  const double cosine = std::cos(rotation);
  const double sine = std::sin(rotation);
  const bool along_columns = scan.axis_along == AxisAlong::Columns;
  const Eigen::Vector3d column =
      along_columns ? Eigen::Vector3d(sine, 0.0, cosine) : Eigen::Vector3d(cosine, 0.0, -sine);
  const Eigen::Vector3d row =
      along_columns ? Eigen::Vector3d(cosine, 0.0, -sine) : Eigen::Vector3d(-sine, 0.0, -cosine);
  const Eigen::Matrix3d turn = turned_about(Eigen::Vector3d::UnitZ(), angle_rad);
  const Eigen::Matrix3d turn_and_tilt =
      turn * turned_about(Eigen::Vector3d::UnitX(), calibration.tilt_rad);
  CameraGeometry camera;
  camera.name = name;
  camera.size_px = scan.size_px;
  camera.pixel_spacing_mm = scan.pixel_spacing_mm;
  camera.source_point = turn * Eigen::Vector3d(0.0, -scan.source_to_axis_mm, 0.0);
  camera.column_direction = turn_and_tilt * column;
  camera.row_direction = turn_and_tilt * row;
  camera.detector_origin_point =
      camera.source_point +
      calibration.source_to_detector_mm * (turn_and_tilt * Eigen::Vector3d::UnitY()) -
      calibration.column_px.at(angle_rad) * scan.pixel_spacing_mm.x() * camera.column_direction -
      calibration.row_px.at(angle_rad) * scan.pixel_spacing_mm.y() * camera.row_direction;
  return camera;
}

}  // namespace af
