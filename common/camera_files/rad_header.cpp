// SPDX-License-Identifier: Apache-2.0
// The .rad text beside a raw projection that xReg takes (xreg-convert-rad-raw-to-proj-data): size,
// pixel spacing, where the source is, and TPosition, which takes the detector's frame to the world
// (mm): origin at the centre of pixel (0, 0), x along columns, y along rows, z towards the source.
#include <algorithm>
#include <array>
#include <optional>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"
#include "base/toml_text.h"
#include "camera_files/camera_text.h"
#include "camera_files/format_readers.h"
#include "geometry/rigid_transform.h"

namespace af {

namespace {

constexpr std::string_view kRadSize = "Size[pixels]:";
constexpr std::string_view kRadStep = "Step[mm]:";
constexpr std::string_view kRadSource = "SourcePosition[mm]:";
constexpr std::string_view kRadPosition = "TPosition:";
constexpr std::array kRadKeys = {
    kRadSize, kRadStep, kRadSource, kRadPosition, std::string_view("DataType:")};

/// The lines of a .rad file.
class RadHeader {
 public:
  explicit RadHeader(const CameraFile& file) : file_(file.name()), lines_(word_lines(file.text)) {}

  /// What stands behind a key on its line.
  [[nodiscard]] Eigen::VectorXd numbers(std::string_view key, Eigen::Index count) const {
    const WordLine& line = line_of(key);
    const std::string rest(line.text.substr(key.size()));
    const auto words = word_lines(rest);
    if (words.empty()) throw FileError(place_of(line, file_), std::string(key) + " has no numbers");
    return numbers_of({line.number, words[0].text, words[0].words}, count, file_);
  }

  /// The four lines behind TPosition.
  [[nodiscard]] RigidTransform world_from_detector() const {
    const auto first = static_cast<std::size_t>(&line_of(kRadPosition) - lines_.data()) + 1;
    if (first + 4 > lines_.size()) throw FileError(file_, "truncated: TPosition has four lines");
    Eigen::Matrix4d matrix;
    for (Eigen::Index row = 0; row < 4; ++row)
      matrix.row(row) =
          numbers_of(lines_[first + static_cast<std::size_t>(row)], 4, file_).transpose();
    throw_if_any(rigidity_problems(matrix), file_ + ": TPosition");
    return rigid_from_matrix(matrix);
  }

  /// Keys that the camera does not need, and lines without one.
  [[nodiscard]] std::vector<std::string> unread() const {
    const auto matrix = static_cast<std::size_t>(&line_of(kRadPosition) - lines_.data());
    std::vector<std::string> unread;
    for (std::size_t i = 0; i < lines_.size(); ++i)
      if ((i <= matrix || i > matrix + 4) &&
          std::ranges::none_of(
              kRadKeys, [&](std::string_view key) { return lines_[i].text.starts_with(key); }))
        unread.push_back(beginning_of(lines_[i].text.substr(0, lines_[i].text.find(':')), 60));
    return unread;
  }

 private:
  [[nodiscard]] const WordLine& line_of(std::string_view key) const {
    const auto is_of_key = [&](const WordLine& line) { return line.text.starts_with(key); };
    const auto found = std::ranges::find_if(lines_, is_of_key);
    if (found == lines_.end()) throw FileError(file_, "'" + std::string(key) + "' is missing");
    if (std::find_if(found + 1, lines_.end(), is_of_key) != lines_.end())
      throw FileError(file_, "'" + std::string(key) + "' is there twice");
    return *found;
  }

  std::string file_;
  std::vector<WordLine> lines_;
};

}  // namespace

bool is_rad_header(const CameraFile& file) {
  const auto lines = word_lines(std::string_view(file.text).substr(0, CameraFile::kHeadBytes));
  const auto has = [&](std::string_view key) {
    return std::ranges::any_of(lines,
                               [&](const WordLine& line) { return line.text.starts_with(key); });
  };
  return has(kRadSource) && has(kRadPosition);
}

StatedRig read_rad_header(const CameraFile& file, const CameraFileOptions& /*options*/) {
  const RadHeader header(file);
  const RigidTransform world_from_detector = header.world_from_detector();
  StatedCamera stated;
  CameraGeometry& camera = stated.geometry;
  camera.size_px = size_of(header.numbers(kRadSize, 2), file.name() + ": Size");
  camera.pixel_spacing_mm = header.numbers(kRadStep, 2);
  camera.source_point = header.numbers(kRadSource, 3);
  camera.detector_origin_point = world_from_detector.translation();
  camera.column_direction = world_from_detector.linear().col(0);
  camera.row_direction = world_from_detector.linear().col(1);
  const double towards_source_mm =
      (camera.source_point - camera.detector_origin_point).dot(world_from_detector.linear().col(2));
  if (!(towards_source_mm > 0.0))
    throw InputError(file.name() +
                     ": the z axis of TPosition must point from the detector to the source");
  StatedRig rig;
  rig.cameras.push_back(stated);
  if (const auto unread = header.unread(); !unread.empty())
    rig.notes.push_back(file.name() + ": not read: " + joined(unread));
  return rig;
}

std::string write_rad_header(const CameraRig& rig) {
  const CameraGeometry& camera = rig.cameras.front();
  if (!camera.is_mirrored())
    throw InputError("camera '" + camera.name +
                     "': a .rad file states mirrored cameras only: its z axis, columns x rows, "
                     "points to the source");
  RigidTransform world_from_detector = RigidTransform::Identity();
  world_from_detector.linear() << camera.column_direction, camera.row_direction,
      -camera.beam_direction();
  world_from_detector.translation() = camera.detector_origin_point;
  const auto line = [](std::string_view key, const Eigen::MatrixXd& numbers) {
    return std::string(key) + " " + numbers_text(numbers.transpose(), " ") + "\n";
  };
  return line(kRadSize, camera.size_px.cast<double>()) + line(kRadStep, camera.pixel_spacing_mm) +
         "DataType: float\n" + line(kRadSource, camera.source_point) + std::string(kRadPosition) +
         "\n" + rows_text(world_from_detector.matrix(), " ");
}

}  // namespace af
