// SPDX-License-Identifier: Apache-2.0
// Cameras in OpenCV's FileStorage YAML, as cv.FileStorage writes them, and in the plain YAML of
// ROS: camera matrix, R (3x3, or a rotation vector) and t, with (column, row, 1) ~ K (R x + t). The
// names of the keys are everybody's own; the usual ones are known. A number behind a name (K1, R2)
// tells several cameras of one file apart.
#include <algorithm>
#include <array>
#include <cctype>
#include <set>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/joined.h"
#include "base/toml_text.h"
#include "camera_files/camera_text.h"
#include "camera_files/format_readers.h"
#include "camera_files/opencv_yaml.h"
#include "geometry/pinhole_camera.h"

namespace af {

namespace {

/// Names of a value, lower case, without '_' and '-'. The first is the one in messages.
using KeyNames = std::vector<std::string>;

const KeyNames& camera_matrix_names() {
  static const KeyNames names = {
      "cameramatrix", "k", "m", "mtx", "intrinsic", "intrinsics", "intrinsicmatrix"};
  return names;
}
const KeyNames& rotation_names() {
  static const KeyNames names = {
      "r", "rotation", "rotationmatrix", "rmat", "rvec", "rotationvector"};
  return names;
}
const KeyNames& translation_names() {
  static const KeyNames names = {"t", "tvec", "translation", "translationvector"};
  return names;
}
const KeyNames& distortion_names() {
  static const KeyNames names = {"distortioncoefficients",
                                 "d",
                                 "dist",
                                 "distcoeffs",
                                 "distortion",
                                 "distortioncoeffs",
                                 "distortioncoefficient",
                                 "distcoeff",
                                 "distcoef",
                                 "distcoefs",
                                 "distortionparameters",
                                 "distortionparams"};
  return names;
}

/// A key without case, '_' and '-', its trailing number apart.
struct PlainKey {
  std::string name;
  std::string number;
};

PlainKey plain_key(const std::string& key) {
  PlainKey plain;
  for (const char c : key)
    if (c != '_' && c != '-')
      plain.name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  while (!plain.name.empty() && std::isdigit(static_cast<unsigned char>(plain.name.back())) != 0) {
    plain.number.insert(plain.number.begin(), plain.name.back());
    plain.name.pop_back();
  }
  return plain;
}

bool is_one_of(const KeyNames& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

/// The values of one file, looked up by any of their names.
class OpenCvValues {
 public:
  explicit OpenCvValues(const CameraFile& file) : file_(file) {
    for (auto& [key, value] : parse_opencv_yaml(file.text, file.name())) {
      const PlainKey plain = plain_key(key);
      values_.push_back({plain, key, value, false});
      if (is_one_of(camera_matrix_names(), plain.name)) numbers_.insert(plain.number);
    }
  }

  /// The numbers that tell the cameras apart; "" is one without a number.
  [[nodiscard]] const std::set<std::string>& camera_numbers() const { return numbers_; }

  /// The value of that camera. An unnumbered R or t is that of the only camera; beside several it
  /// is of a stereo calibration, the second camera's relative to the first, and not taken.
  [[nodiscard]] const YamlValue& of_camera(const KeyNames& names,
                                           const std::string& number,
                                           const char* what) const {
    if (numbers_.size() == 1) return required(names, number, what);
    if (const YamlValue* const value = find_exactly(names, number); value != nullptr) return *value;
    const bool is_stereo = find_exactly(names, "") != nullptr;
    throw InputError(file_.name() + ": " + names.front() + number + " is missing: " + what +
                     (is_stereo ? "; that without a number, of a stereo calibration, is relative "
                                  "to the first camera"
                                : ""));
  }

  /// The value of that camera, or the one that all cameras share.
  [[nodiscard]] const YamlValue* find(const KeyNames& names, const std::string& number) const {
    const YamlValue* const own = find_exactly(names, number);
    return own != nullptr ? own : find_exactly(names, "");
  }

  [[nodiscard]] const YamlValue& required(const KeyNames& names,
                                          const std::string& number,
                                          const char* what) const {
    if (const YamlValue* const value = find(names, number); value != nullptr) return *value;
    throw InputError(file_.name() + ": " + names.front() + number + " is missing: " + what);
  }

  /// Keys of which no value was taken.
  [[nodiscard]] std::vector<std::string> unread() const {
    std::vector<std::string> keys;
    for (const Entry& entry : values_)
      if (!entry.is_taken) keys.push_back(beginning_of(entry.key, 60));
    return keys;
  }

  /// A vector of that many numbers, stored as row, column or list.
  [[nodiscard]] Eigen::VectorXd vector(const YamlValue& value,
                                       Eigen::Index count,
                                       const std::string& name) const {
    if (value.numbers.size() != count)
      throw FileError(place(value),
                      name,
                      std::to_string(count) + " numbers",
                      std::to_string(value.numbers.size()));
    return value.numbers.transpose().reshaped();
  }

  [[nodiscard]] std::string place(const YamlValue& value) const {
    return file_.name() + ":" + std::to_string(value.line);
  }

 private:
  struct Entry {
    PlainKey plain;
    std::string key;
    YamlValue value;
    mutable bool is_taken = false;
  };

  [[nodiscard]] const YamlValue* find_exactly(const KeyNames& names,
                                              const std::string& number) const {
    for (const Entry& entry : values_) {
      if (entry.plain.number != number || !is_one_of(names, entry.plain.name)) continue;
      entry.is_taken = true;
      return &entry.value;
    }
    return nullptr;
  }

  const CameraFile& file_;
  std::vector<Entry> values_;
  std::set<std::string> numbers_;
};

Eigen::Matrix3d matrix3(const OpenCvValues& values, const YamlValue& value, const char* name) {
  if (value.numbers.rows() == 3 && value.numbers.cols() == 3) return value.numbers;
  const Eigen::VectorXd numbers = values.vector(value, 9, name);
  return numbers.reshaped<Eigen::RowMajor>(3, 3);
}

/// A rotation matrix, or OpenCV's rotation vector: axis times angle in radians.
Eigen::Matrix3d rotation(const OpenCvValues& values, const YamlValue& value) {
  if (value.numbers.size() != 3) return matrix3(values, value, "R");
  const Eigen::Vector3d vector = values.vector(value, 3, "rvec");
  const double angle_rad = vector.norm();
  if (angle_rad == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle_rad, vector / angle_rad).toRotationMatrix();
}

void read_size(const OpenCvValues& values, const std::string& number, StatedCamera& camera) {
  const YamlValue* const width = values.find({"imagewidth", "width"}, number);
  const YamlValue* const height = values.find({"imageheight", "height"}, number);
  const YamlValue* const both = values.find({"imagesize", "size", "resolution"}, number);
  camera.has_size = both != nullptr || (width != nullptr && height != nullptr);
  camera.geometry.size_px = {1, 1};
  if (both != nullptr)
    camera.geometry.size_px = size_of(values.vector(*both, 2, "image_size"), values.place(*both));
  else if (camera.has_size)
    camera.geometry.size_px = size_of(
        {values.vector(*width, 1, "image_width")[0], values.vector(*height, 1, "image_height")[0]},
        values.place(*width));
}

/// OpenCV's first eight coefficients; more, of thin prisms and tilted sensors, must be 0. A
/// negative focal length along rows turns x and y of PixelDistortion's K round.
LensDistortion read_distortion_of(const OpenCvValues& values,
                                  const std::string& number,
                                  const Eigen::Matrix3d& k) {
  LensDistortion distortion;
  const YamlValue* const model = values.find({"distortionmodel"}, number);
  if (model != nullptr && model->text != "plumb_bob" && model->text != "rational_polynomial")
    throw InputError(values.place(*model) + ": distortion_model",
                     "'" + beginning_of(model->text, 60) + "'",
                     "must be plumb_bob or rational_polynomial");
  const YamlValue* const stated = values.find(distortion_names(), number);
  if (stated == nullptr || stated->numbers.size() == 0) return distortion;
  const Eigen::VectorXd numbers = stated->numbers.transpose().reshaped();
  constexpr std::array<Eigen::Index, 5> kCounts = {4, 5, 8, 12, 14};
  if (std::ranges::find(kCounts, numbers.size()) == kCounts.end())
    throw FileError(values.place(*stated),
                    "distortion_coefficients",
                    "4, 5, 8, 12 or 14 numbers",
                    std::to_string(numbers.size()));
  const Eigen::Index known = std::min<Eigen::Index>(numbers.size(), 8);
  if (!numbers.tail(numbers.size() - known).isZero(0.0))
    throw InputError(values.place(*stated) +
                     ": distortion of thin prisms or tilted sensors (s1 ... s4, tx, ty) that is "
                     "not 0 is not supported: undistort the images first");
  std::copy_n(numbers.begin(), known, distortion.coefficients.begin());
  return k(1, 1) < 0.0 ? distortion.with_rows_flipped() : distortion;
}

StatedCamera read_camera(const OpenCvValues& values, const std::string& number) {
  PinholeCamera pinhole;
  pinhole.pixels_from_camera =
      matrix3(values, values.required(camera_matrix_names(), number, "K, 3x3"), "camera_matrix");
  constexpr const char* kNeedsPose =
      "K alone does not say where the camera stands; add R (3x3, or rvec) and t (or tvec), with "
      "x_camera = R x_room + t, mm";
  pinhole.camera_from_room =
      rotation(values, values.of_camera(rotation_names(), number, kNeedsPose));
  pinhole.translation_mm =
      values.vector(values.of_camera(translation_names(), number, kNeedsPose), 3, "t");
  StatedCamera camera;
  read_size(values, number, camera);
  double column_spacing_mm = 1.0;
  const YamlValue* const spacing = values.find({"pixelspacingmm"}, number);
  camera.has_spacing = spacing != nullptr;
  if (spacing != nullptr) {
    column_spacing_mm = values.vector(*spacing, 2, "pixel_spacing_mm")[0];
    if (!(column_spacing_mm > 0.0))
      throw InputError(values.place(*spacing) + ": pixel_spacing_mm must be positive");
  }
  const YamlValue* const name = values.find({"cameraname", "name"}, number);
  camera.has_name = name != nullptr && !name->text.empty();
  const std::string name_text = camera.has_name ? name->text : "camera" + number;
  camera.geometry =
      camera_from_pinhole(name_text, pinhole, column_spacing_mm, camera.geometry.size_px);
  camera.geometry.distortion = read_distortion_of(values, number, pinhole.pixels_from_camera);
  return camera;
}

std::string yaml_matrix(const char* key, const Eigen::MatrixXd& matrix) {
  return std::string(key) + ": !!opencv-matrix\n   rows: " + std::to_string(matrix.rows()) +
         "\n   cols: " + std::to_string(matrix.cols()) + "\n   dt: d\n   data: [ " +
         numbers_text(matrix, ", ") + " ]\n";
}

}  // namespace

bool is_opencv_yaml(const CameraFile& file) {
  const auto lines = word_lines(file.text);
  return std::ranges::any_of(lines, [](const WordLine& line) {
    const std::size_t colon = line.text.find(':');
    return colon != std::string_view::npos &&
           is_one_of(
               camera_matrix_names(),
               plain_key(std::string(line.text.substr(0, std::min<std::size_t>(colon, 64)))).name);
  });
}

StatedRig read_opencv_yaml(const CameraFile& file, const CameraFileOptions& /*options*/) {
  const OpenCvValues values(file);
  StatedRig stated;
  if (values.camera_numbers().empty())
    throw InputError(file.name() + ": camera_matrix is missing: K, 3x3");
  for (const std::string& number : values.camera_numbers())
    stated.cameras.push_back(read_camera(values, number));
  if (const YamlValue* const point = values.find({"isocenterpoint"}, ""); point != nullptr)
    stated.isocenter_point = Eigen::Vector3d(values.vector(*point, 3, "isocenter_point"));
  if (const auto unread = values.unread(); !unread.empty())
    stated.notes.push_back(file.name() + ": not read: " + joined(unread));
  return stated;
}

std::string write_opencv_yaml(const CameraRig& rig) {
  const CameraGeometry& camera = rig.cameras.front();
  const PinholeCamera pinhole = pinhole_of(camera);
  return "%YAML:1.0\n---\ncamera_name: \"" + camera.name +
         "\"\nimage_width: " + std::to_string(camera.size_px.x()) +
         "\nimage_height: " + std::to_string(camera.size_px.y()) + "\n" +
         yaml_matrix("camera_matrix", pinhole.pixels_from_camera) +
         yaml_matrix(
             "distortion_coefficients",
             Eigen::Map<const Eigen::VectorXd>(
                 camera.distortion.coefficients.data(),
                 static_cast<Eigen::Index>(std::max<std::size_t>(5, camera.distortion.count())))) +
         yaml_matrix("R", pinhole.camera_from_room) + yaml_matrix("t", pinhole.translation_mm) +
         yaml_matrix("pixel_spacing_mm", camera.pixel_spacing_mm) +
         yaml_matrix("isocenter_point", rig.isocenter_point);
}

}  // namespace af
