// SPDX-License-Identifier: Apache-2.0
// Projection matrices as text: pixels from room mm, (column, row, 1) ~ P (x, 1), three lines of
// four numbers per camera or twelve numbers on one line. Comments begin with '#'; those that this
// project writes state what a matrix leaves open:
//     # camera AP
//     # size_px 256 256
//     # pixel_spacing_mm 1.190625 1.190625
//     # isocenter_point 0 0 0
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/named_rows.h"
#include "camera_files/camera_text.h"
#include "camera_files/format_readers.h"
#include "geometry/pinhole_camera.h"

namespace af {

namespace {

constexpr std::size_t kMatrixRows = 3;
constexpr std::size_t kMatrixColumns = 4;
constexpr std::size_t kMatrixNumbers = kMatrixRows * kMatrixColumns;
constexpr std::size_t kMostMatrices = 10000;

bool is_comment(const WordLine& line) {
  return line.text.front() == '#';
}

bool holds_matrix_row(const WordLine& line) {
  return (line.words.size() == kMatrixColumns || line.words.size() == kMatrixNumbers) &&
         std::ranges::all_of(line.words, is_number);
}

/// Gathers a camera from its comments and its rows.
class MatrixReader {
 public:
  explicit MatrixReader(const CameraFile& file) : file_(file) {}

  StatedRig run() {
    for (const WordLine& line : word_lines(file_.text)) {
      if (is_comment(line))
        take_comment(line);
      else if (line.words.size() == kMatrixNumbers && row_count_ == 0)
        take_matrix(numbers_of(line, kMatrixNumbers, file_.name()));
      else
        take_row(line);
    }
    if (row_count_ != 0 || stated_.cameras.empty())
      throw FileError(file_.name(), "truncated: a projection matrix has 3 rows of 4 numbers");
    return stated_;
  }

 private:
  /// "# key numbers" of those keys that matter here; all other comments are left alone.
  void take_comment(const WordLine& line) {
    std::vector<std::string_view> words = line.words;
    if (words.front() == "#") words.erase(words.begin());
    if (words.size() < 2) return;
    const auto numbers = [&](Eigen::Index count) {
      WordLine rest = line;
      rest.words.assign(words.begin() + 1, words.end());
      return numbers_of(rest, count, file_.name());
    };
    if (words.front() == "camera") {
      next_.has_name = true;
      const std::size_t at = line.text.find("camera") + std::string_view("camera").size();
      next_.geometry.name = std::string(trimmed_view(line.text.substr(at)));
    } else if (words.front() == "size_px") {
      next_.geometry.size_px = size_of(numbers(2), place_of(line, file_.name()) + ": size_px");
      next_.has_size = true;
    } else if (words.front() == "pixel_spacing_mm") {
      next_.geometry.pixel_spacing_mm = numbers(2);
      if (!(next_.geometry.pixel_spacing_mm.minCoeff() > 0.0))
        throw InputError(place_of(line, file_.name()) + ": pixel_spacing_mm",
                         std::string(line.text),
                         "must be positive");
      next_.has_spacing = true;
    } else if (words.front() == "isocenter_point") {
      stated_.isocenter_point = numbers(3);
    }
  }

  void take_row(const WordLine& line) {
    rows_.row(static_cast<Eigen::Index>(row_count_++)) =
        numbers_of(line, kMatrixColumns, file_.name()).transpose();
    if (row_count_ == kMatrixRows) take_matrix(rows_.transpose().reshaped());
  }

  void take_matrix(const Eigen::VectorXd& numbers) {
    row_count_ = 0;
    if (stated_.cameras.size() == kMostMatrices)
      throw InputError(file_.name(), "more than 10000 matrices", "are too many cameras");
    Eigen::Matrix<double, 3, 4> matrix;
    for (Eigen::Index row = 0; row < matrix.rows(); ++row)
      matrix.row(row) = numbers.segment<kMatrixColumns>(row * matrix.cols()).transpose();
    CameraGeometry& camera = next_.geometry;
    camera = from_matrix(matrix, camera);
    stated_.cameras.push_back(next_);
    next_ = empty_;
  }

  /// The side on which the object is becomes known with the isocentre only.
  [[nodiscard]] CameraGeometry from_matrix(const Eigen::Matrix<double, 3, 4>& matrix,
                                           const CameraGeometry& stated) const {
    const std::string name = stated.name.empty() ? file_.name() + ", matrix " +
                                                       std::to_string(stated_.cameras.size() + 1)
                                                 : stated.name;
    // A point with positive w, wherever it is.
    const Eigen::Vector3d axis = matrix.row(2).head<3>();
    const double norm = axis.squaredNorm();
    const Eigen::Vector3d front =
        norm > 0.0 ? Eigen::Vector3d((1.0 - matrix(2, 3)) / norm * axis) : Eigen::Vector3d::Zero();
    Eigen::Vector2d spacing_mm = stated.pixel_spacing_mm;
    if (!next_.has_spacing) spacing_mm.y() = spacing_mm.x() * focal_ratio(matrix);
    CameraGeometry camera =
        CameraGeometry::from_projection_matrix(name, matrix, spacing_mm, stated.size_px, front);
    camera.name = stated.name;
    return camera;
  }

  /// Focal length of columns by that of rows, in pixels.
  static double focal_ratio(const Eigen::Matrix<double, 3, 4>& matrix) {
    const Eigen::Vector3d depth = matrix.row(2).head<3>().normalized();
    const auto focal = [&](Eigen::Index row) {
      const Eigen::Vector3d axis = matrix.row(row).head<3>();
      return (axis - axis.dot(depth) * depth).norm();
    };
    const double ratio = focal(0) / focal(1);
    return ratio > 0.0 && std::isfinite(ratio) ? ratio : 1.0;
  }

  static StatedCamera nothing_stated() {
    StatedCamera camera;
    camera.geometry.size_px = {1, 1};
    camera.has_size = false;
    camera.has_spacing = false;
    camera.knows_front = false;
    return camera;
  }

  const CameraFile& file_;
  const StatedCamera empty_ = nothing_stated();
  StatedCamera next_ = empty_;
  StatedRig stated_;
  Eigen::Matrix<double, 3, 4> rows_;
  std::size_t row_count_ = 0;
};

}  // namespace

bool is_matrix_text(const CameraFile& file) {
  std::size_t rows = 0;
  for (const WordLine& line : word_lines(file.text)) {
    if (is_comment(line)) continue;
    if (!holds_matrix_row(line)) return false;
    rows += line.words.size() == kMatrixColumns ? 1 : kMatrixRows;
  }
  // Four rows are a pose.
  return rows > 0 && rows % kMatrixRows == 0;
}

StatedRig read_matrix_text(const CameraFile& file, const CameraFileOptions& /*options*/) {
  return MatrixReader(file).run();
}

std::string write_matrix_text(const CameraRig& rig) {
  std::string text =
      "# Projection matrices: pixels (column, row; integers are centres) from room mm.\n";
  text += "# isocenter_point " + numbers_text(rig.isocenter_point.transpose(), " ") + "\n";
  for (const CameraGeometry& camera : rig.cameras)
    text += "# camera " + camera.name + "\n# size_px " +
            numbers_text(camera.size_px.cast<double>().transpose(), " ") + "\n# pixel_spacing_mm " +
            numbers_text(camera.pixel_spacing_mm.transpose(), " ") + "\n" +
            rows_text(projection_matrix_of(camera), " ");
  return text;
}

}  // namespace af
