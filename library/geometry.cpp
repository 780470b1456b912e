// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/geometry.h"

#include <utility>

#include "base/error.h"
#include "library/translation.h"
#include "study/pose_file.h"
#include "study/rig_file.h"

namespace af::library {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajor4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

/// Deviation from orthonormal that rigidity_problems() tolerates.
constexpr double kRotationTolerance = 1e-5;

CameraGeometry geometry_of(const api::Camera& camera) {
  return {camera.name,
          vector_of(camera.source_point),
          vector_of(camera.detector_origin_point),
          vector_of(camera.column_direction),
          vector_of(camera.row_direction),
          Eigen::Vector2d(camera.pixel_spacing_mm.data()),
          Eigen::Vector2i(camera.size_px.data()),
          {}};
}

CameraRig rig_of(const api::Rig& rig) {
  CameraRig result{vector_of(rig.isocenter_point), {}};
  for (const api::Camera& camera : rig.cameras) result.cameras.push_back(geometry_of(camera));
  return result;
}

}  // namespace

Eigen::Vector3d vector_of(const api::Vector3& values) {
  return Eigen::Vector3d(values.data());
}

api::Vector3 vector_of(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

RigidTransform transform_of(const api::Pose& pose, const std::string& name) {
  const Eigen::Matrix4d matrix = Eigen::Map<const RowMajor4>(pose.room_from_ct.data());
  std::vector<std::string> problems = rigidity_problems(matrix);
  for (std::string& problem : problems) problem.insert(0, name + ": ");
  throw_if_any(problems);
  return rigid_from_matrix(matrix);
}

api::Pose pose_of(const RigidTransform& transform) {
  api::Pose pose;
  Eigen::Map<RowMajor4>(pose.room_from_ct.data()) = transform.matrix();
  return pose;
}

CameraGeometry checked_camera(const api::Camera& camera) {
  CameraGeometry geometry = geometry_of(camera);
  throw_if_any(problems(geometry));
  return geometry;
}

api::Camera camera_of(const CameraGeometry& camera) {
  return {camera.name,
          vector_of(camera.source_point),
          vector_of(camera.detector_origin_point),
          vector_of(camera.column_direction),
          vector_of(camera.row_direction),
          {camera.pixel_spacing_mm.x(), camera.pixel_spacing_mm.y()},
          {camera.size_px.x(), camera.size_px.y()}};
}

XrayBeamOptions checked_beam(const api::Beam& beam) {
  XrayBeamOptions options;
  options.spectrum.tube_kvp = beam.tube_kvp;
  options.spectrum.aluminium_mm = beam.aluminium_mm;
  options.scatter_to_primary = beam.scatter_to_primary;
  throw_if_any(field_problems(options));
  return options;
}

PoseFrame checked_frame(const api::PoseFrame& frame) {
  PoseFrame result;
  result.rotation = Eigen::Map<const RowMajor3>(frame.rotation.data());
  result.center_ct_mm = vector_of(frame.center_ct_mm);
  result.center_room_mm = vector_of(frame.center_room_mm);
  const Eigen::Matrix3d gram = result.rotation.transpose() * result.rotation;
  const double error = (gram - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  // NaN fails the comparison, and is refused.
  if (!(error <= kRotationTolerance && result.rotation.determinant() > 0.0))
    throw InputError("frame: rotation = not a rotation: must be orthonormal, right-handed");
  if (!(result.center_ct_mm.allFinite() && result.center_room_mm.allFinite()))
    throw InputError("frame: center_ct_mm, center_room_mm = not finite: must be finite numbers");
  return result;
}

api::PoseFrame frame_of(const PoseFrame& frame) {
  api::PoseFrame result;
  Eigen::Map<RowMajor3>(result.rotation.data()) = frame.rotation;
  result.center_ct_mm = vector_of(frame.center_ct_mm);
  result.center_room_mm = vector_of(frame.center_room_mm);
  return result;
}

CtGrid grid_of(const api::CtGrid& grid) {
  return {grid.size,
          vector_of(grid.origin_mm),
          vector_of(grid.spacing_mm),
          Eigen::Map<const RowMajor3>(grid.direction.data())};
}

api::CtGrid grid_of(const CtGrid& grid) {
  api::CtGrid result{grid.size, vector_of(grid.origin_mm), vector_of(grid.spacing_mm), {}};
  Eigen::Map<RowMajor3>(result.direction.data()) = grid.direction;
  return result;
}

}  // namespace af::library

namespace attenuation_fields {

namespace library = af::library;

Camera Camera::from_projection_matrix(const std::string& name,
                                      const std::array<double, 12>& pixels_from_room,
                                      const std::array<double, 2>& pixel_spacing_mm,
                                      const std::array<int, 2>& size_px,
                                      const Vector3& isocenter_point) {
  using RowMajor34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  return library::translated([&] {
    return library::camera_of(af::CameraGeometry::from_projection_matrix(
        name,
        Eigen::Map<const RowMajor34>(pixels_from_room.data()),
        Eigen::Vector2d(pixel_spacing_mm.data()),
        Eigen::Vector2i(size_px.data()),
        library::vector_of(isocenter_point)));
  });
}

void Camera::require_sound() const {
  library::translated([&] { library::checked_camera(*this); });
}

std::array<double, 2> Camera::project(const Vector3& room_point) const {
  return library::translated([&] {
    const Eigen::Vector2d pixel =
        library::checked_camera(*this).project(library::vector_of(room_point));
    return std::array{pixel.x(), pixel.y()};
  });
}

Rig Rig::read(const std::string& name_or_path, std::vector<std::string>* warnings) {
  return library::translated_reading([&] {
    const af::CameraRig rig = af::read_rig(name_or_path, warnings);
    Rig result{library::vector_of(rig.isocenter_point), {}};
    for (const af::CameraGeometry& camera : rig.cameras) {
      if (!camera.distortion.is_none() && warnings != nullptr)
        warnings->push_back(name_or_path + ": the distortion of camera '" + camera.name +
                            "' is left out: it is of stored X-rays, and studies see to it");
      result.cameras.push_back(library::camera_of(camera));
    }
    return result;
  });
}

void Rig::require_sound() const {
  library::translated([&] { af::throw_if_any(problems(library::rig_of(*this))); });
}

std::string Rig::to_toml() const {
  require_sound();
  return library::translated([&] { return af::rig_to_toml(library::rig_of(*this)); });
}

const Camera& Rig::camera(const std::string& camera_name) const {
  return library::translated([&]() -> const Camera& {
    const af::CameraRig rig = library::rig_of(*this);
    const auto found = &rig.camera(camera_name) - rig.cameras.data();
    return cameras[static_cast<std::size_t>(found)];
  });
}

PoseFrame PoseFrame::about(const Pose& nominal, const Vector3& center_ct_mm) {
  return library::translated([&] {
    return library::frame_of(af::PoseFrame::about(library::transform_of(nominal, "nominal pose"),
                                                  library::vector_of(center_ct_mm)));
  });
}

Pose PoseFrame::pose(const Vector3& rotation_deg, const Vector3& translation_mm) const {
  return library::translated([&] {
    return library::pose_of(af::pose_of_deg_and_mm(library::checked_frame(*this),
                                                   {rotation_deg[0],
                                                    rotation_deg[1],
                                                    rotation_deg[2],
                                                    translation_mm[0],
                                                    translation_mm[1],
                                                    translation_mm[2]},
                                                   "rotation_deg, translation_mm"));
  });
}

std::array<double, 6> PoseFrame::parameters(const Pose& pose) const {
  return library::translated([&] {
    return af::parameters_from_pose(library::checked_frame(*this),
                                    library::transform_of(pose, "pose"))
        .deg_and_mm();
  });
}

Pose read_pose(const std::filesystem::path& path) {
  return library::translated_reading([&] { return library::pose_of(af::read_pose(path)); });
}

}  // namespace attenuation_fields
