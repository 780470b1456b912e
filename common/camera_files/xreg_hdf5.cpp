// SPDX-License-Identifier: Apache-2.0
// Cameras of xReg in HDF5: its projection data (groups proj-000, proj-001 ... with a group cam
// each), a camera alone, and the group proj-params of the DeepFluoro data set. `extrinsic` takes
// world mm to the camera's frame, `intrinsic` that to pixels: (column, row, 1) ~ K x, integers are
// pixel centres. cam-coord-frame-type says which frame: the source at the origin and the detector
// at +z or at -z (that of DeepFluoro), or the origin on the detector and the source at +z.
#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/joined.h"
#include "base/named_rows.h"
#include "base/number_text.h"
#include "camera_files/format_readers.h"
#include "geometry/pinhole_camera.h"
#include "geometry/rigid_transform.h"
#include "hdf5_files/hdf5_input.h"
#include "hdf5_files/hdf5_output.h"

namespace af {

namespace {

constexpr const char* kDeepFluoroGroup = "/proj-params";
constexpr const char* kCountOfProjections = "/num-projs";
constexpr const char* kFrameType = "cam-coord-frame-type";
constexpr const char* kXRegIsocenter = "/isocenter-point";  ///< this project's own
constexpr const char* kXRegCameraName = "camera-name";      ///< this project's own

enum class XRegFrame { DetectorAtPlusZ, DetectorAtMinusZ, OriginOnDetector };

struct XRegFrameRow {
  const char* name;
  XRegFrame frame;
};
constexpr std::array<XRegFrameRow, 3> kXRegFrames = {
    {{"origin-at-focal-pt-det-pos-z", XRegFrame::DetectorAtPlusZ},
     {"origin-at-focal-pt-det-neg-z", XRegFrame::DetectorAtMinusZ},
     {"origin-on-det", XRegFrame::OriginOnDetector}}};

/// Half a turn about the rows' axis.
Eigen::DiagonalMatrix<double, 3> half_turn() {
  return Eigen::DiagonalMatrix<double, 3>(-1.0, 1.0, -1.0);
}

/// One camera's datasets.
struct XRegValues {
  Eigen::Matrix3d intrinsic;
  Eigen::Matrix4d extrinsic;
  Eigen::Vector2d spacing_mm;  ///< columns, rows
  Eigen::Vector2i size_px;
  XRegFrame frame = XRegFrame::DetectorAtMinusZ;
};

/// The same camera with z along the beam and the source at the origin. Of a point x in xReg's frame
/// y = half_turn() x has its depth in z, and x_0 / z = y_0 / y_2 where z = x_2 and -y_0 / y_2 where
/// z = focal length - x_2.
PinholeCamera pinhole_of_xreg(const XRegValues& values) {
  PinholeCamera pinhole;
  pinhole.pixels_from_camera = values.intrinsic;
  pinhole.camera_from_room = values.extrinsic.topLeftCorner<3, 3>();
  pinhole.translation_mm = values.extrinsic.topRightCorner<3, 1>();
  if (values.frame == XRegFrame::DetectorAtPlusZ) return pinhole;
  pinhole.camera_from_room = half_turn() * pinhole.camera_from_room;
  pinhole.translation_mm = half_turn() * pinhole.translation_mm;
  if (values.frame == XRegFrame::DetectorAtMinusZ) {
    pinhole.pixels_from_camera.col(1) *= -1.0;
    return pinhole;
  }
  pinhole.pixels_from_camera.col(0) *= -1.0;
  const Eigen::Vector2d focal_mm =
      values.intrinsic.diagonal().head<2>().cwiseAbs().cwiseProduct(values.spacing_mm);
  pinhole.translation_mm.z() += focal_mm.mean();
  return pinhole;
}

/// Reads the datasets of one camera's group.
class XRegGroup {
 public:
  /// DeepFluoro's names of the spacings begin with `spacing_prefix`.
  XRegGroup(const Hdf5Input& file, std::string group, std::string spacing_prefix)
      : file_(file), group_(std::move(group)), spacing_prefix_(std::move(spacing_prefix)) {}

  /// `notes` get what of the group is not read.
  [[nodiscard]] StatedCamera camera(std::vector<std::string>& notes) const {
    XRegValues values;
    values.intrinsic = matrix<3>("intrinsic");
    values.extrinsic = matrix<4>("extrinsic");
    throw_if_any(rigidity_problems(values.extrinsic), path("extrinsic"));
    values.size_px =
        size_of({scalar("num-cols"), scalar("num-rows")}, path("num-cols and num-rows"));
    values.spacing_mm = {scalar(spacing_prefix_ + "col-spacing"),
                         scalar(spacing_prefix_ + "row-spacing")};
    if (!(values.spacing_mm.minCoeff() > 0.0))
      throw InputError(path(spacing_prefix_ + "col-spacing") + ": spacings must be above 0");
    if (file_.holds(group_ + "/" + kFrameType)) values.frame = frame();
    StatedCamera stated;
    stated.has_name = file_.holds(group_ + "/" + kXRegCameraName);
    const std::string name = stated.has_name ? file_.text(group_ + "/" + kXRegCameraName) : group_;
    stated.geometry =
        camera_from_pinhole(name, pinhole_of_xreg(values), values.spacing_mm.x(), values.size_px);
    check_row_spacing(stated.geometry, values.spacing_mm.y());
    const std::vector<std::string> known = {"intrinsic",
                                            "extrinsic",
                                            "num-cols",
                                            "num-rows",
                                            spacing_prefix_ + "col-spacing",
                                            spacing_prefix_ + "row-spacing",
                                            kFrameType,
                                            kXRegCameraName,
                                            kXRegIsocenter + 1};
    std::vector<std::string> unread = file_.names_in(group_.empty() ? "/" : group_);
    std::erase_if(unread, [&](const std::string& dataset) {
      return std::ranges::find(known, dataset) != known.end();
    });
    if (!unread.empty()) notes.push_back(path(joined(unread)) + ": not read");
    return stated;
  }

 private:
  [[nodiscard]] std::string path(const std::string& dataset) const {
    return file_.name() + ": " + group_ + "/" + dataset;
  }

  [[nodiscard]] XRegFrame frame() const {
    const std::string name = file_.text(group_ + "/" + kFrameType);
    return required_row(kXRegFrames, path(kFrameType), name).frame;
  }

  [[nodiscard]] double scalar(const std::string& dataset) const {
    const Hdf5Numbers numbers = file_.numbers(group_ + "/" + dataset, 1);
    if (numbers.values.size() != 1) throw FileError(path(dataset), "is no number");
    return numbers.values.front();
  }

  template <int Size>
  [[nodiscard]] Eigen::Matrix<double, Size, Size> matrix(const std::string& dataset) const {
    const Hdf5Numbers numbers = file_.numbers(group_ + "/" + dataset, std::size_t{Size} * Size);
    if (numbers.extents != std::vector<std::size_t>{Size, Size})
      throw FileError(path(dataset),
                      "is no matrix of " + std::to_string(Size) + " x " + std::to_string(Size));
    return Eigen::Map<const Eigen::Matrix<double, Size, Size, Eigen::RowMajor>>(
        numbers.values.data());
  }

  /// Both focal lengths are one distance in pixels.
  void check_row_spacing(const CameraGeometry& camera, double row_spacing_mm) const {
    constexpr double kTolerance = 1e-2;
    if (std::abs(camera.pixel_spacing_mm.y() - row_spacing_mm) <= kTolerance * row_spacing_mm)
      return;
    throw InputError(path(spacing_prefix_ + "row-spacing"),
                     number_text(row_spacing_mm),
                     "must agree with the intrinsic matrix and the spacing of columns: " +
                         number_text(camera.pixel_spacing_mm.y()) + " mm");
  }

  const Hdf5Input& file_;
  std::string group_;
  std::string spacing_prefix_;
};

/// As xReg names them.
std::string projection_group(std::size_t index) {
  const std::string digits = std::to_string(index);
  return "/proj-" + std::string(digits.size() < 3 ? 3 - digits.size() : 0, '0') + digits;
}

std::size_t count_of_projections(const Hdf5Input& file) {
  const Hdf5Numbers count = file.numbers(kCountOfProjections, 1);
  constexpr double kMost = 10000.0;
  const double number = count.values.empty() ? 0.0 : count.values.front();
  if (!(number >= 1.0 && number <= kMost) || number != std::floor(number))
    throw InputError(kCountOfProjections,
                     number_text(number),
                     "must be a whole number between 1 and 10000",
                     file.name());
  return static_cast<std::size_t>(number);
}

StatedRig rig_in(const Hdf5Input& hdf5) {
  StatedRig stated;
  if (hdf5.holds(kDeepFluoroGroup)) {
    stated.cameras.push_back(XRegGroup(hdf5, kDeepFluoroGroup, "pixel-").camera(stated.notes));
  } else if (hdf5.holds(kCountOfProjections)) {
    const std::size_t count = count_of_projections(hdf5);
    for (std::size_t i = 0; i < count; ++i)
      stated.cameras.push_back(
          XRegGroup(hdf5, projection_group(i) + "/cam", "").camera(stated.notes));
  } else {
    stated.cameras.push_back(XRegGroup(hdf5, "", "").camera(stated.notes));
  }
  if (hdf5.holds(kXRegIsocenter)) {
    const Hdf5Numbers point = hdf5.numbers(kXRegIsocenter, 3);
    if (point.values.size() != 3) throw FileError(hdf5.name(), "isocenter-point has not 3 numbers");
    stated.isocenter_point = Eigen::Map<const Eigen::Vector3d>(point.values.data());
  }
  return stated;
}

template <typename Read>
auto read_hdf5(const CameraFile& file, const Read& read) {
  return read_distrusted(
      file.name(), [&] { return Hdf5Input::of_file(file.path); }, read);
}

}  // namespace

bool is_xreg_hdf5(const CameraFile& file) {
  if (!is_hdf5_head(file.head)) return false;
  try {
    return read_hdf5(file, [](const Hdf5Input& hdf5) {
      return hdf5.holds(kDeepFluoroGroup) || hdf5.holds(kCountOfProjections) ||
             hdf5.holds(std::string("/") + kFrameType);
    });
  } catch (const FileError&) {
    return false;
  }
}

StatedRig read_xreg_hdf5(const CameraFile& file, const CameraFileOptions& /*options*/) {
  if (!is_hdf5_head(file.head)) throw FileError(file.name(), "is no HDF5 file");
  return read_hdf5(file, rig_in);
}

std::string write_xreg_hdf5(const CameraRig& rig) {
  Hdf5Output file;
  file.add_attribute("/", "xreg-type", "proj-data");
  file.add_count(kCountOfProjections, rig.cameras.size());
  const Eigen::Vector3d& isocenter = rig.isocenter_point;
  file.add_numbers(kXRegIsocenter, {isocenter.x(), isocenter.y(), isocenter.z()});
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const CameraGeometry& camera = rig.cameras[i];
    PinholeCamera pinhole = pinhole_of(camera);
    const bool is_mirrored = camera.is_mirrored();
    if (is_mirrored) {
      pinhole.pixels_from_camera.col(1) *= -1.0;
      pinhole.camera_from_room = half_turn() * pinhole.camera_from_room;
      pinhole.translation_mm = half_turn() * pinhole.translation_mm;
    }
    RigidTransform camera_from_room = RigidTransform::Identity();
    camera_from_room.linear() = pinhole.camera_from_room;
    camera_from_room.translation() = pinhole.translation_mm;
    const std::string projection = projection_group(i);
    const std::string group = projection + "/cam";
    file.add_group(projection);
    file.add_group(group);
    file.add_attribute(group, "xreg-type", "cam-model");
    file.add_fixed_text(group + "/" + kXRegCameraName, camera.name);
    file.add_count(group + "/num-rows", static_cast<std::size_t>(camera.size_px.y()));
    file.add_count(group + "/num-cols", static_cast<std::size_t>(camera.size_px.x()));
    file.add_scalar(group + "/row-spacing", camera.pixel_spacing_mm.y());
    file.add_scalar(group + "/col-spacing", camera.pixel_spacing_mm.x());
    file.add_fixed_text(group + "/" + kFrameType, kXRegFrames[is_mirrored ? 1 : 0].name);
    file.add_matrix(group + "/intrinsic", pinhole.pixels_from_camera);
    file.add_matrix(group + "/extrinsic", camera_from_room.matrix());
  }
  return file.bytes();
}

}  // namespace af
