// SPDX-License-Identifier: Apache-2.0
#include "camera_files/stated_rig.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/number_text.h"
#include "camera_files/rig_toml.h"
#include "geometry/pinhole_camera.h"
#include "text/csv_table.h"

namespace af {

namespace {

/// Where the detector stands when only the rays are known: the magnification of a usual C-arm.
constexpr double kDefaultMagnification = 1.5;

std::string point_text(const Eigen::Vector3d& point) {
  return number_text(point.x()) + "," + number_text(point.y()) + "," + number_text(point.z());
}

/// A derived point, for people: to 0.01 mm.
std::string rounded_text(const Eigen::Vector3d& point) {
  return fixed_text(point.x(), 2) + ", " + fixed_text(point.y(), 2) + ", " +
         fixed_text(point.z(), 2);
}

/// The ray through the middle of the image, or through the foot of the source on the detector when
/// the image's size is not known.
Ray central_ray(const CameraGeometry& camera) {
  const Eigen::Vector2d middle = 0.5 * (camera.size_px.cast<double>() - Eigen::Vector2d::Ones());
  return camera.ray(middle.x(), middle.y());
}

/// The same lines of sight, with source and detector on the other sides.
CameraGeometry turned_around(const CameraGeometry& camera) {
  CameraGeometry turned = camera;
  turned.detector_origin_point = 2.0 * camera.source_point - camera.detector_origin_point;
  turned.column_direction = -camera.column_direction;
  turned.row_direction = -camera.row_direction;
  return turned;
}

/// A file name's part that can be a camera's name.
std::string name_of_file(const std::string& file) {
  constexpr std::size_t kLongest = 90;
  std::string name = std::filesystem::path(file).stem().string().substr(0, kLongest);
  for (char& c : name)
    if (static_cast<unsigned char>(c) <= ' ' || c == '=' || c == ',' || c == '\x7f') c = '_';
  if (!camera_name_problem(name).empty()) name = "camera";
  return name;
}

/// Joins what the files state, and completes it from the options.
class RigCompletion {
 public:
  RigCompletion(const std::vector<StatedRig>& stated, const CameraFileOptions& options)
      : options_(options) {
    for (const StatedRig& rig : stated)
      for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
        cameras_.push_back(rig.cameras[i]);
        files_.push_back(rig.file);
        if (!rig.cameras[i].has_name)
          cameras_.back().geometry.name =
              name_of_file(rig.file) +
              (rig.cameras.size() > 1 ? "-" + std::to_string(i + 1) : std::string());
      }
    for (const StatedRig& rig : stated) {
      notes_.insert(notes_.end(), rig.notes.begin(), rig.notes.end());
      if (rig.isocenter_point) set_isocenter(*rig.isocenter_point, rig.file);
    }
  }

  CameraRig run(std::vector<std::string>* warnings) {
    set_names();
    set_sizes();
    set_pixel_grids();
    set_units();
    find_isocenter();
    face_isocenter();
    set_spacings();
    flip_images();
    CameraRig rig;
    rig.isocenter_point = *isocenter_;
    for (const StatedCamera& camera : cameras_) rig.cameras.push_back(camera.geometry);
    throw_if_any(problems(rig), files_.empty() ? "" : files_.front());
    for (CameraGeometry& camera : rig.cameras) clean_axes(camera);
    note_mirrored();
    if (warnings != nullptr) warnings->insert(warnings->end(), notes_.begin(), notes_.end());
    return rig;
  }

 private:
  [[nodiscard]] std::string place(std::size_t i) const {
    return files_[i] + ": camera '" + cameras_[i].geometry.name + "'";
  }

  void set_isocenter(const Eigen::Vector3d& point, const std::string& file) {
    constexpr double kToleranceMm = 1e-6;
    if (isocenter_ && !((point - *isocenter_).norm() <= kToleranceMm))
      throw InputError("isocenter_point",
                       point_text(point),
                       "must be that of " + isocenter_file_ + ": " + point_text(*isocenter_),
                       file);
    isocenter_ = point;
    isocenter_file_ = file;
  }

  void set_names() {
    if (!options_.names.empty() && options_.names.size() != cameras_.size())
      throw InputError("--rig-names",
                       std::to_string(options_.names.size()) + " names",
                       "must be as many as there are cameras: " + std::to_string(cameras_.size()));
    std::set<std::string> taken;
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      std::string& name = cameras_[i].geometry.name;
      if (!options_.names.empty()) name = options_.names[i];
      if (const std::string problem = camera_name_problem(name); !problem.empty())
        throw InputError("camera name", "'" + name + "'", problem, files_[i]);
      const std::string stem = name;
      // Two files of the same name in two folders; names that somebody stated must differ.
      for (int n = 2; taken.contains(name) && !cameras_[i].has_name && options_.names.empty(); ++n)
        name = stem + "-" + std::to_string(n);
      taken.insert(name);
    }
  }

  void set_sizes() {
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      Eigen::Vector2i& size_px = cameras_[i].geometry.size_px;
      if (options_.size_px.empty() && cameras_[i].has_size) continue;
      if (options_.size_px.empty())
        throw InputError(
            place(i) +
            ": the size of its images is not in the file: state it with af-inspect --rig-from and "
            "--rig-size-px COLUMNS,ROWS");
      const Eigen::Vector2i given(options_.size_px[0], options_.size_px[1]);
      if (cameras_[i].has_size && size_px != given)
        refuse_contradiction("--rig-size-px",
                             std::to_string(given.x()) + "," + std::to_string(given.y()),
                             std::to_string(size_px.x()) + "," + std::to_string(size_px.y()),
                             i);
      size_px = given;
    }
  }

  /// Detectors that the files state in mm get their pixels.
  void set_pixel_grids() {
    bool is_used = options_.detector_origin_mm.empty();
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      if (cameras_[i].has_pixel_grid) continue;
      if (options_.pixel_spacing_mm.empty())
        throw InputError(
            place(i) +
            ": the pixel spacing is not in the file: state it with af-inspect --rig-from and "
            "--rig-pixel-spacing-mm COLUMN,ROW");
      CameraGeometry& camera = cameras_[i].geometry;
      camera.pixel_spacing_mm = {options_.pixel_spacing_mm[0], options_.pixel_spacing_mm[1]};
      Eigen::Vector2d first_mm = -0.5 * (camera.size_px.cast<double>() - Eigen::Vector2d::Ones())
                                            .cwiseProduct(camera.pixel_spacing_mm);
      if (!options_.detector_origin_mm.empty()) {
        first_mm = {options_.detector_origin_mm[0], options_.detector_origin_mm[1]};
        is_used = true;
      }
      camera.detector_origin_point +=
          first_mm.x() * camera.column_direction + first_mm.y() * camera.row_direction;
    }
    if (!is_used)
      throw InputError(
          "--rig-detector-origin-mm: must not be given: the files state where the pixels are");
  }

  void set_units() {
    if (!options_.unit_mm) return;
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      if (cameras_[i].has_spacing)
        throw InputError("--rig-unit-mm",
                         number_text(*options_.unit_mm),
                         "must not be given: the file's lengths are mm",
                         place(i));
      CameraGeometry& camera = cameras_[i].geometry;
      const Eigen::Vector3d moved = (*options_.unit_mm - 1.0) * camera.source_point;
      camera.source_point += moved;
      camera.detector_origin_point += moved;
    }
    if (isocenter_) *isocenter_ *= *options_.unit_mm;
  }

  void find_isocenter() {
    if (options_.isocenter_point) {
      const auto& point = *options_.isocenter_point;
      set_isocenter({point[0], point[1], point[2]}, "--rig-isocenter-point");
    }
    if (isocenter_) return;
    std::vector<CameraGeometry> cameras;
    cameras.reserve(cameras_.size());
    for (const StatedCamera& camera : cameras_) cameras.push_back(camera.geometry);
    if (const auto nearest = nearest_point_of_central_rays(cameras); nearest) {
      isocenter_ = *nearest;
      notes_.push_back("the isocentre is not in the files; taken as the point nearest to the " +
                       std::to_string(cameras.size()) + " central rays, (" +
                       rounded_text(*nearest) + ") mm; --rig-isocenter-point states another");
      return;
    }
    if (cameras.empty()) throw InputError("the files hold no camera");
    const Ray ray = central_ray(cameras.front());
    const double along = -ray.origin_point.dot(ray.direction);
    constexpr double kLeastMm = 1.0;
    if (cameras.size() > 1 ||
        !(along > kLeastMm || (!cameras_.front().knows_front && along < -kLeastMm)))
      throw InputError(place(0) +
                       ": the isocentre is not in the file, and its only central ray does not pass "
                       "the room's origin: state it with af-inspect --rig-from and "
                       "--rig-isocenter-point X,Y,Z");
    isocenter_ = ray.origin_point + along * ray.direction;
    notes_.push_back(
        "the isocentre is not in the file; taken as the point of the central ray nearest to the "
        "room's origin, (" +
        point_text(*isocenter_) + ") mm; --rig-isocenter-point states another");
  }

  void face_isocenter() {
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      CameraGeometry& camera = cameras_[i].geometry;
      if (camera.depth_mm(*isocenter_) > 0.0) continue;
      if (!cameras_[i].knows_front) camera = turned_around(camera);
      if (!(camera.depth_mm(*isocenter_) > 0.0) && !cameras_[i].has_spacing)
        throw InputError("isocenter_point",
                         point_text(*isocenter_),
                         "must lie in front of the source, on the detector's side",
                         place(i));
    }
  }

  void set_spacings() {
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      CameraGeometry& camera = cameras_[i].geometry;
      if (!options_.pixel_spacing_mm.empty()) {
        if (!cameras_[i].has_spacing)
          camera = with_column_spacing(camera, options_.pixel_spacing_mm[0]);
        check_spacing(camera, i);
        continue;
      }
      if (cameras_[i].has_spacing) continue;
      camera = with_column_spacing(camera,
                                   kDefaultMagnification * camera.depth_mm(*isocenter_) /
                                       camera.source_detector_distance_mm() *
                                       camera.pixel_spacing_mm.x());
      notes_.push_back(place(i) + ": the pixel spacing is not in the file; the detector is put " +
                       fixed_text(camera.source_detector_distance_mm(), 2) +
                       " mm from the source, which makes columns " +
                       fixed_text(camera.pixel_spacing_mm.x(), 4) +
                       " mm apart. Rays do not depend on it; --rig-pixel-spacing-mm states it");
    }
  }

  void check_spacing(const CameraGeometry& camera, std::size_t i) const {
    constexpr double kAspectTolerance = 1e-2;
    const Eigen::Vector2d stated(options_.pixel_spacing_mm[0], options_.pixel_spacing_mm[1]);
    if ((camera.pixel_spacing_mm - stated).cwiseAbs().maxCoeff() <=
        kAspectTolerance * stated.minCoeff())
      return;
    refuse_contradiction(
        "--rig-pixel-spacing-mm",
        number_text(stated.x()) + "," + number_text(stated.y()),
        number_text(camera.pixel_spacing_mm.x()) + "," + number_text(camera.pixel_spacing_mm.y()),
        i);
  }

  [[noreturn]] void refuse_contradiction(const char* option,
                                         const std::string& given,
                                         const std::string& stated,
                                         std::size_t i) const {
    throw InputError(option, given, "must agree with the file: " + stated, place(i));
  }

  void flip_images() {
    if (options_.flip.empty()) return;
    const bool flips_rows = options_.flip == "rows";
    for (StatedCamera& stated : cameras_) {
      CameraGeometry& camera = stated.geometry;
      const Eigen::Index axis = flips_rows ? 1 : 0;
      Eigen::Vector3d& direction = flips_rows ? camera.row_direction : camera.column_direction;
      camera.detector_origin_point +=
          (camera.size_px[axis] - 1) * camera.pixel_spacing_mm[axis] * direction;
      direction = -direction;
      if (flips_rows) camera.distortion = camera.distortion.with_rows_flipped();
    }
  }

  void note_mirrored() {
    for (std::size_t i = 0; i < cameras_.size(); ++i)
      if (cameras_[i].geometry.is_mirrored())
        notes_.push_back(place(i) +
                         ": mirrored: column_direction x row_direction points against the beam, so "
                         "its images show left and right swapped");
  }

  const CameraFileOptions& options_;
  std::vector<StatedCamera> cameras_;
  std::vector<std::string> files_;  ///< of each camera
  std::vector<std::string> notes_;
  std::optional<Eigen::Vector3d> isocenter_;
  std::string isocenter_file_;
};

}  // namespace

CameraRig completed_rig(const std::vector<StatedRig>& stated,
                        const CameraFileOptions& options,
                        std::vector<std::string>* warnings) {
  return RigCompletion(stated, options).run(warnings);
}

std::optional<Eigen::Vector3d> nearest_point_of_central_rays(
    const std::vector<CameraGeometry>& cameras) {
  constexpr double kLeastSpread = 1e-6;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (const CameraGeometry& camera : cameras) {
    const Ray ray = central_ray(camera);
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    sum += across;
    moment += across * ray.origin_point;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum);
  if (!(solver.eigenvalues()[0] > kLeastSpread)) return std::nullopt;
  return Eigen::Vector3d(sum.ldlt().solve(moment));
}

}  // namespace af
