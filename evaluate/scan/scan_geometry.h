// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "geometry/camera_geometry.h"

namespace af {

/// The direction of the images along which a scan's rotation axis runs. +z of the object is the
/// direction of increasing column, or of decreasing row.
enum class AxisAlong { Columns, Rows };

/// A circular cone-beam scan as its maker states it. The frame is that of the turning object, mm:
/// +z is the rotation axis, which passes through the origin. The camera of angle 0 has its source
/// at (0, -R, 0), and the camera of angle a is that one turned by a about +z. Images are never
/// mirrored: column x row points along the beam.
struct CircularScan {
  double source_to_axis_mm = 0.0;
  double source_to_detector_mm = 0.0;
  Eigen::Vector2d pixel_spacing_mm = Eigen::Vector2d::Ones();  ///< column, row
  Eigen::Vector2i size_px = Eigen::Vector2i::Zero();           ///< columns, rows
  AxisAlong axis_along = AxisAlong::Rows;
  /// Where the perpendicular from the source meets the detector (column, row), as stated. None: its
  /// middle.
  std::optional<Eigen::Vector2d> beam_foot_px;
  std::vector<double> angles_rad;  ///< one per view, in the order in which they were taken
  /// The share by which the stated distance from source to detector may be off; 0: it was measured.
  double distance_tolerance = 0.0;

  /// The scan as seen by pixels `factor` times as wide and high. Columns and rows that fill no
  /// coarse pixel are left out. Throws InputError when fewer than 16 pixels remain on a side.
  [[nodiscard]] CircularScan binned(int factor) const;
  /// The same scan with all lengths multiplied, which does not change projections.
  [[nodiscard]] CircularScan enlarged(double factor) const;
  /// The views `first`, `first` + `stride`, ... below `end`.
  [[nodiscard]] static std::vector<int> every(int first, int stride, int end);
  /// The stated foot of the beam, or the detector's middle.
  [[nodiscard]] Eigen::Vector2d stated_foot_px() const;
};

/// What the stated detector sees at the axis, mm: heights along +z, widths along the tangent.
struct AxisView {
  double lowest_mm = 0.0;         ///< along the axis; negative
  double highest_mm = 0.0;        ///< along the axis
  double narrow_mm = 0.0;         ///< across, on the side that sees less
  double wide_mm = 0.0;           ///< across, on the other side
  bool is_narrow_before = false;  ///< the side that sees less is that of the first column (or row)
};
AxisView view_at_axis(const CircularScan& scan);

/// Whether the detector is displaced so far that it is meant to see the other side of the object
/// half a turn later: the narrow side is less than 0.7 of the wide one.
bool is_displaced(const AxisView& view);

/// The least whole number by which to multiply a scan's lengths so that it is at least as large as
/// a patient's head: 60 mm across at the axis, and the source 200 mm from it. Registrations from
/// starts that are tens of mm off need that much room.
int room_for_registration(const CircularScan& scan);

/// "source_to_axis_mm = -3: must be above 0" and so on. The views must cover the whole circle (the
/// largest gap between neighbouring angles is at most 30 degrees or three times the median one),
/// and so must the even ones and each half of them.
std::vector<std::string> problems(const CircularScan& scan);

/// How much of the circle each of these angles stands for, rad: half the gaps to its neighbours.
/// The shares sum to 2 pi. Angles may repeat and exceed a turn.
std::vector<double> angle_shares_rad(const std::vector<double>& angles_rad);

/// The angles of consecutive views (steps of at most 90 degrees, all but a hundredth of the way in
/// one direction), without the jumps by a turn that a list may have: 350, 355, 0 become 350, 355,
/// 360. None when the views are not consecutive.
std::optional<std::vector<double>> continued_rad(const std::vector<double>& angles_rad);

/// The angles (rad) of the first and the last of consecutive views, as continued_rad() gives them.
struct Sweep {
  double first_rad = 0.0;
  double last_rad = 0.0;
};
/// None where the views are not consecutive: their angles do not tell time.
std::optional<Sweep> sweep_of(const CircularScan& scan);

/// Functions of the view angle a that describe a geometry: 1, cos a, sin a, cos 2a, ... If views
/// are consecutive there is also a drift, which grows evenly by 1 from the first view to the last.
struct AngleBasis {
  int harmonics = 0;
  std::optional<Sweep> drift;

  [[nodiscard]] Eigen::Index size() const { return 1 + 2 * harmonics + (drift ? 1 : 0); }
  /// The values of the functions, in this order.
  [[nodiscard]] Eigen::VectorXd at(double angle_rad) const;
};

/// A value that changes with the view angle: the product of the basis and the coefficients.
struct AngleSeries {
  AngleBasis basis;
  Eigen::VectorXd coefficients = Eigen::VectorXd::Zero(1);

  AngleSeries() = default;
  explicit AngleSeries(const AngleBasis& series_basis)
      : basis(series_basis), coefficients(Eigen::VectorXd::Zero(series_basis.size())) {}
  [[nodiscard]] double at(double angle_rad) const { return basis.at(angle_rad).dot(coefficients); }
};

/// What a scan's geometry really is. The distance from source to axis stays the stated one, because
/// it is the unit of length of a self-calibration.
struct ScanCalibration {
  double source_to_detector_mm = 0.0;
  double tilt_rad = 0.0;     ///< of the detector, about the tangent of the circle
  AngleSeries column_px;     ///< where the beam's perpendicular meets the detector
  AngleSeries row_px;        ///< likewise
  AngleSeries rotation_rad;  ///< of the detector in its plane, from its column towards its row axis

  /// The stated geometry: an ideal circle, with room for these functions of the angle.
  static ScanCalibration nominal(const CircularScan& scan, const AngleBasis& basis = {});
  /// The same geometry for the scan's binned() pixels, and back with a factor of 1 / factor.
  [[nodiscard]] ScanCalibration binned(double factor) const;
};

/// The camera at an angle (frame of the object, mm), named `name`.
CameraGeometry scan_camera(const CircularScan& scan,
                           const ScanCalibration& calibration,
                           double angle_rad,
                           const std::string& name = "view");

}  // namespace af
