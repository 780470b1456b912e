// SPDX-License-Identifier: Apache-2.0
// RTK's ThreeDCircularProjectionGeometry (IEC 61217). Room: RTK's fixed frame, mm, origin at the
// isocentre, y the axis of rotation; at gantry angle 0 the source is at z = +SID. With
//     R = Rz(-InPlaneAngle) Rx(-OutOfPlaneAngle) Ry(-GantryAngle)
// the source is at (SourceOffsetX, SourceOffsetY, SourceToIsocenterDistance) of the rotated frame
// and the detector's point (u, v) mm at (u + ProjectionOffsetX, v + ProjectionOffsetY,
// SourceToIsocenterDistance - SourceToDetectorDistance). Columns run along u and rows along v, so
// that the images of RTK are mirrored in the sense of this project.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <strings.h>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/number_text.h"
#include "base/toml_text.h"
#include "camera_files/format_readers.h"
#include "camera_files/xml_elements.h"
#include "geometry/rigid_transform.h"

namespace af {

namespace {

constexpr const char* kRoot = "RTKThreeDCircularGeometry";
constexpr std::size_t kMostProjections = 100000;

/// Those of collimators do not matter to where pixels see.
constexpr std::array kKnownNumbers = {"SourceToIsocenterDistance",
                                      "SourceToDetectorDistance",
                                      "GantryAngle",
                                      "OutOfPlaneAngle",
                                      "InPlaneAngle",
                                      "SourceOffsetX",
                                      "SourceOffsetY",
                                      "ProjectionOffsetX",
                                      "ProjectionOffsetY",
                                      "RadiusCylindricalDetector",
                                      "CollimationUInf",
                                      "CollimationUSup",
                                      "CollimationVInf",
                                      "CollimationVSup"};

/// Parameters by name.
using RtkValues = std::map<std::string, double>;

/// As RTK compares names.
bool is_named(const XmlElement& element, const char* name) {
  return strcasecmp(element.name.c_str(), name) == 0;
}

std::string place_of(const XmlElement& element, const std::string& file) {
  return file + ":" + std::to_string(element.line);
}

[[noreturn]] void refuse(const XmlElement& element, const std::string& file) {
  throw InputError("element",
                   "<" + beginning_of(element.name, 100) + ">",
                   "is not known at this place of RTK's geometry",
                   place_of(element, file));
}

/// RTK takes Angle for GantryAngle.
void take_number(const XmlElement& element, const std::string& file, RtkValues& values) {
  const auto* const known = std::ranges::find_if(
      kKnownNumbers, [&](const char* name) { return is_named(element, name); });
  const bool is_angle = is_named(element, "Angle");
  if (!is_angle && known == kKnownNumbers.end()) refuse(element, file);
  if (!element.children.empty()) refuse(element.children.front(), file);
  values[is_angle ? "GantryAngle" : *known] =
      number_of(trimmed_view(element.text), place_of(element, file) + ": " + element.name);
}

double value_of(const RtkValues& values, const char* name) {
  const auto found = values.find(name);
  return found == values.end() ? 0.0 : found->second;
}

/// Rows u, v and the direction to the source.
Eigen::Matrix3d rotated_from_fixed(double gantry_deg,
                                   double out_of_plane_deg,
                                   double in_plane_deg) {
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  return (AngleAxisd(-in_plane_deg * kRadPerDeg, Vector3d::UnitZ()) *
          AngleAxisd(-out_of_plane_deg * kRadPerDeg, Vector3d::UnitX()) *
          AngleAxisd(-gantry_deg * kRadPerDeg, Vector3d::UnitY()))
      .toRotationMatrix();
}

CameraGeometry camera_of(const RtkValues& values, const std::string& place) {
  const double source_isocenter_mm = value_of(values, "SourceToIsocenterDistance");
  const double source_detector_mm = value_of(values, "SourceToDetectorDistance");
  if (!(source_detector_mm > 0.0))
    throw InputError("SourceToDetectorDistance",
                     number_text(source_detector_mm),
                     "must be above 0: parallel beams are no cameras",
                     place);
  if (value_of(values, "RadiusCylindricalDetector") != 0.0)
    throw InputError("RadiusCylindricalDetector",
                     number_text(value_of(values, "RadiusCylindricalDetector")),
                     "must be 0: curved detectors are not supported",
                     place);
  const Eigen::Matrix3d axes = rotated_from_fixed(value_of(values, "GantryAngle"),
                                                  value_of(values, "OutOfPlaneAngle"),
                                                  value_of(values, "InPlaneAngle"));
  CameraGeometry camera;
  camera.size_px = {1, 1};
  camera.source_point = axes.transpose() * Eigen::Vector3d(value_of(values, "SourceOffsetX"),
                                                           value_of(values, "SourceOffsetY"),
                                                           source_isocenter_mm);
  camera.detector_origin_point =
      axes.transpose() * Eigen::Vector3d(value_of(values, "ProjectionOffsetX"),
                                         value_of(values, "ProjectionOffsetY"),
                                         source_isocenter_mm - source_detector_mm);
  camera.column_direction = axes.row(0);
  camera.row_direction = axes.row(1);
  return camera;
}

/// The matrix that RTK stores beside the parameters, from fixed mm to detector mm, must be theirs.
void check_matrix(const XmlElement& element,
                  const CameraGeometry& camera,
                  const std::string& file) {
  const std::string place = place_of(element, file) + ": Matrix";
  Eigen::Matrix<double, 3, 4> matrix;
  Eigen::Index count = 0;
  for (const WordLine& line : word_lines(element.text))
    for (const std::string_view word : line.words) {
      const double number = number_of(word, place);
      if (count < matrix.size()) matrix(count / 4, count % 4) = number;
      ++count;
    }
  if (count != matrix.size())
    throw FileError(place, "numbers", std::to_string(matrix.size()), std::to_string(count));
  constexpr double kToleranceMm = 1e-2;
  for (const Eigen::Vector3d& offset :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(50, 30, -20), Eigen::Vector3d(-10, 60, 40)}) {
    const Eigen::Vector3d seen = matrix * offset.homogeneous();
    if ((seen.hnormalized() - camera.project(offset)).norm() <= kToleranceMm) continue;
    throw InputError(place + ": does not agree with the parameters of its projection, to 0.01 mm");
  }
}

/// `values` are what stands before the projection, in other projections too, and hold for the next.
StatedCamera read_projection(const XmlElement& projection,
                             const std::string& file,
                             RtkValues& values) {
  const XmlElement* matrix = nullptr;
  for (const XmlElement& element : projection.children)
    if (is_named(element, "Matrix"))
      matrix = &element;
    else
      take_number(element, file, values);
  StatedCamera stated;
  stated.geometry = camera_of(values, place_of(projection, file));
  stated.has_size = false;
  stated.has_pixel_grid = false;
  if (matrix != nullptr) check_matrix(*matrix, stated.geometry, file);
  return stated;
}

/// RTK refuses all others, and files without one.
void check_version(const XmlElement& root, const std::string& file) {
  const auto found = root.attributes.find("version");
  const std::string version = found == root.attributes.end() ? "" : found->second;
  if (version != "2" && version != "3")
    throw InputError(
        "version", "'" + beginning_of(version, 20) + "'", "must be 2 or 3", place_of(root, file));
}

/// The angles whose Rz(-in plane) Rx(-out of plane) Ry(-gantry) has the rows `axes`, degrees.
struct RtkAngles {
  double gantry_deg = 0.0;
  double out_of_plane_deg = 0.0;
  double in_plane_deg = 0.0;
};

RtkAngles rtk_angles(const Eigen::Matrix3d& axes) {
  RtkAngles angles;
  angles.out_of_plane_deg = -kDegPerRad * std::asin(std::clamp(axes(2, 1), -1.0, 1.0));
  // A beam along y: gantry and in-plane angle turn about the same axis, so one of them is free.
  constexpr double kAlongY = 1e-9;
  if (std::hypot(axes(2, 0), axes(2, 2)) < kAlongY) {
    angles.in_plane_deg = -kDegPerRad * std::atan2(axes(1, 0), axes(0, 0));
    return angles;
  }
  angles.gantry_deg = -kDegPerRad * std::atan2(-axes(2, 0), axes(2, 2));
  angles.in_plane_deg = -kDegPerRad * std::atan2(-axes(0, 1), axes(1, 1));
  return angles;
}

std::string xml_number(const char* name, double value) {
  return std::string("    <") + name + ">" + number_text(value + 0.0) + "</" + name + ">\n";
}

}  // namespace

bool is_rtk_geometry(const CameraFile& file) {
  return file.text.find(std::string("<") + kRoot) != std::string::npos;
}

StatedRig read_rtk_geometry(const CameraFile& file, const CameraFileOptions& /*options*/) {
  const XmlElement root = parse_xml(file.text, file.name());
  if (root.name != kRoot)
    throw FileError(file.name(), "root element", kRoot, beginning_of(root.name, 100));
  check_version(root, file.name());
  StatedRig stated;
  stated.isocenter_point = Eigen::Vector3d::Zero();
  RtkValues values;
  for (const XmlElement& element : root.children) {
    if (is_named(element, "Projection"))
      stated.cameras.push_back(read_projection(element, file.name(), values));
    else
      take_number(element, file.name(), values);
    if (stated.cameras.size() > kMostProjections)
      throw InputError(file.name() + ": more than 100000 projections are too many cameras");
  }
  if (stated.cameras.empty()) throw FileError(file.name(), "has no <Projection>");
  return stated;
}

std::string write_rtk_geometry(const CameraRig& rig) {
  constexpr double kOriginMm = 1e-9;
  if (!(rig.isocenter_point.norm() <= kOriginMm))
    throw InputError("the rig's isocenter_point must be (0, 0, 0): RTK has it at the origin");
  std::string text = std::string("<?xml version=\"1.0\"?>\n<!DOCTYPE RTKGEOMETRY>\n<") + kRoot +
                     " version=\"3\">\n";
  for (const CameraGeometry& camera : rig.cameras) {
    if (!camera.is_mirrored())
      throw InputError("camera '" + camera.name +
                       "': RTK's images are mirrored, row 0 at the lowest v: --rig-flip rows gives "
                       "the camera of the images with their rows in the other order");
    Eigen::Matrix3d axes;
    axes << camera.column_direction.transpose(), camera.row_direction.transpose(),
        -camera.beam_direction().transpose();
    const Eigen::Vector3d source = axes * camera.source_point;
    const Eigen::Vector2d middle = 0.5 * (camera.size_px.cast<double>() - Eigen::Vector2d::Ones());
    const Eigen::Vector3d center = axes * camera.detector_point(middle.x(), middle.y());
    const RtkAngles angles = rtk_angles(axes);
    text += "  <Projection>\n" + xml_number("SourceToIsocenterDistance", source.z()) +
            xml_number("SourceToDetectorDistance", camera.source_detector_distance_mm()) +
            xml_number("GantryAngle", angles.gantry_deg) +
            xml_number("OutOfPlaneAngle", angles.out_of_plane_deg) +
            xml_number("InPlaneAngle", angles.in_plane_deg) +
            xml_number("SourceOffsetX", source.x()) + xml_number("SourceOffsetY", source.y()) +
            xml_number("ProjectionOffsetX", center.x()) +
            xml_number("ProjectionOffsetY", center.y()) + "  </Projection>\n";
  }
  return text + "</" + kRoot + ">\n";
}

}  // namespace af
