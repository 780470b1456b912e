// SPDX-License-Identifier: Apache-2.0
// MayaCam files: one camera each, from the calibration of biplane videoradiography (XROMM, XMALab)
// for Autoscoper. Neither states its unit of length nor the pixels' spacing.
#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/toml_text.h"
#include "camera_files/camera_text.h"
#include "camera_files/format_readers.h"
#include "geometry/pinhole_camera.h"
#include "geometry/rigid_transform.h"

namespace af {

namespace {

constexpr int kMayaCam1Lines = 5;

StatedRig one_camera(const CameraGeometry& geometry) {
  StatedRig stated;
  stated.cameras.push_back({.geometry = geometry, .has_spacing = false});
  return stated;
}

/// The lines of a MayaCam 2 file behind their titles.
class MayaCam2Sections {
 public:
  explicit MayaCam2Sections(const CameraFile& file) : file_(file), lines_(word_lines(file.text)) {}

  /// `rows` lines of `columns` numbers behind the line `title`, which are taken out.
  Eigen::MatrixXd take(const char* title, Eigen::Index rows, Eigen::Index columns) {
    const auto at =
        std::ranges::find_if(lines_, [&](const WordLine& line) { return line.text == title; });
    if (at == lines_.end())
      throw FileError(file_.name(), std::string("the line '") + title + "' is missing");
    Eigen::MatrixXd matrix(rows, columns);
    for (Eigen::Index row = 0; row < rows; ++row) {
      if (lines_.end() - at <= row + 1)
        throw FileError(file_.name(),
                        std::string("truncated: '") + title + "' needs " + std::to_string(rows) +
                            " lines of numbers");
      matrix.row(row) = numbers_of(at[row + 1], columns, file_.name()).transpose();
    }
    lines_.erase(at, at + rows + 1);
    return matrix;
  }

  void refuse_the_rest() const {
    if (!lines_.empty())
      throw InputError(place_of(lines_.front(), file_.name()) + ": line",
                       "'" + beginning_of(lines_.front().text, 60) + "'",
                       "is not known in a MayaCam 2 file");
  }

 private:
  const CameraFile& file_;
  std::vector<WordLine> lines_;
};

}  // namespace

bool is_mayacam2(const CameraFile& file) {
  const auto lines = word_lines(std::string_view(file.text).substr(0, CameraFile::kHeadBytes));
  return !lines.empty() && lines.front().text == "image size";
}

/// (column, row, 1) ~ K (R x + t), as OpenCV has it: row 0 on top, integers are pixel centres.
StatedRig read_mayacam2(const CameraFile& file, const CameraFileOptions& /*options*/) {
  MayaCam2Sections sections(file);
  const Eigen::MatrixXd size = sections.take("image size", 1, 2);
  PinholeCamera pinhole;
  pinhole.pixels_from_camera = sections.take("camera matrix", 3, 3);
  pinhole.camera_from_room = sections.take("rotation", 3, 3);
  pinhole.translation_mm = sections.take("translation", 3, 1);
  sections.refuse_the_rest();
  return one_camera(camera_from_pinhole(
      file.name(), pinhole, 1.0, size_of(size.row(0).transpose(), file.name() + ": image size")));
}

std::string write_mayacam2(const CameraRig& rig) {
  const CameraGeometry& camera = rig.cameras.front();
  const PinholeCamera pinhole = pinhole_of(camera);
  return "image size\n" + numbers_text(camera.size_px.cast<double>().transpose(), ",") +
         "\n\ncamera matrix\n" + rows_text(pinhole.pixels_from_camera, ",") + "\nrotation\n" +
         rows_text(pinhole.camera_from_room, ",") + "\ntranslation\n" +
         rows_text(pinhole.translation_mm, ",");
}

bool is_mayacam1(const CameraFile& file) {
  const auto lines = word_lines(std::string_view(file.text).substr(0, CameraFile::kHeadBytes));
  return lines.size() == kMayaCam1Lines && std::ranges::all_of(lines, [](const WordLine& line) {
           return line.words.size() == 3 && line.text.find(',') != std::string_view::npos &&
                  std::ranges::all_of(line.words, is_number);
         });
}

/// Line 1: the source. Line 2: degrees about the camera's own axes x, y, z, turned about z first,
/// then y, then x; the camera looks along -z, y is up. Line 3: where Maya puts the film, not read.
/// Line 4: u0 and v0 (pixels from 1, v0 from the lowest row upwards) and the focal length in
/// pixels, of either sign. Line 5: the film's scale, not read, columns and rows; 0 means 1024.
StatedRig read_mayacam1(const CameraFile& file, const CameraFileOptions& /*options*/) {
  const auto lines = word_lines(file.text);
  std::array<Eigen::Vector3d, kMayaCam1Lines> values;
  if (lines.size() != kMayaCam1Lines)
    throw FileError(file.name(), "lines", "5 lines of 3 numbers", std::to_string(lines.size()));
  for (std::size_t i = 0; i < lines.size(); ++i) values[i] = numbers_of(lines[i], 3, file.name());
  constexpr double kDefaultSide = 1024.0;
  Eigen::Vector2d size = values[4].tail<2>();
  size = (size.array() == 0.0).select(kDefaultSide, size);
  const Eigen::Vector2i size_px = size_of(size, place_of(lines[4], file.name()));
  const Eigen::Matrix3d room_from_maya = rotation_from_angles(values[1] / kDegPerRad);
  const double focal_px = std::abs(values[3].z());
  PinholeCamera pinhole;
  pinhole.pixels_from_camera << focal_px, 0.0, values[3].x() - 1.0, 0.0, focal_px,
      size_px.y() - values[3].y(), 0.0, 0.0, 1.0;
  pinhole.camera_from_room << room_from_maya.col(0).transpose(), -room_from_maya.col(1).transpose(),
      -room_from_maya.col(2).transpose();
  pinhole.translation_mm = -pinhole.camera_from_room * values[0];
  return one_camera(camera_from_pinhole(file.name(), pinhole, 1.0, size_px));
}

std::string write_mayacam1(const CameraRig& rig) {
  const CameraGeometry& camera = rig.cameras.front();
  constexpr double kAspectTolerance = 1e-9;
  const Eigen::Vector2d spacing_mm = camera.pixel_spacing_mm;
  if (camera.is_mirrored() ||
      std::abs(spacing_mm.x() - spacing_mm.y()) > kAspectTolerance * spacing_mm.x())
    throw InputError("camera '" + camera.name +
                     "': MayaCam 1 cannot state a mirrored camera or pixels that are not square");
  const PinholeCamera pinhole = pinhole_of(camera);
  Eigen::Matrix3d room_from_maya = pinhole.camera_from_room.transpose();
  room_from_maya.rightCols<2>() *= -1.0;
  const Eigen::Matrix3d& k = pinhole.pixels_from_camera;
  const Eigen::Vector2d size = camera.size_px.cast<double>();
  const double u0 = k(0, 2) + 1.0;
  const double v0 = size.y() - k(1, 2);
  const double scale = spacing_mm.x();
  Eigen::Matrix<double, kMayaCam1Lines, 3> lines;
  lines << camera.source_point.transpose(),
      (angles_from_rotation(room_from_maya) * kDegPerRad).transpose(),
      scale * (0.5 * size.x() - u0), scale * (0.5 * size.y() - v0), -scale * k(0, 0), u0, v0,
      -k(0, 0), scale, size.x(), size.y();
  return rows_text(lines, ",");
}

}  // namespace af
