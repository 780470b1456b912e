// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "attenuation_fields/errors.h"
#include "python/bindings/arrays.h"
#include "python/bindings/pickled.h"
#include "python/bindings/texts.h"

namespace attenuation_fields::python {
namespace {

using namespace pybind11::literals;

/// Throws InputError unless the camera or rig is without problems.
template <typename Owner>
Owner sound(Owner owner) {
  owner.require_sound();
  return owner;
}

/// Sets a member, unless the owner would not be sound with it.
template <typename Owner, typename Value>
void set_soundly(Owner& owner, Value Owner::*member, const Value& value) {
  Owner changed = owner;
  changed.*member = value;
  owner = sound(std::move(changed));
}

/// A member of three numbers, seen as an array.
template <typename Owner>
void bind_vector(py::class_<Owner>& owner, const char* name, Vector3 Owner::*member) {
  owner.def_property(
      name,
      [member](const Owner& self) { return array_of(self.*member); },
      [member, name](Owner& self, const Numbers& values) {
        set_soundly(self, member, vector_of(values, name));
      });
}

/// An axis of the detector. Axes are set one after the other, so their orthogonality is checked
/// only where the camera is used.
void bind_axis(py::class_<Camera>& camera, const char* name, Vector3 Camera::*member) {
  camera.def_property(
      name,
      [member](const Camera& self) { return array_of(self.*member); },
      [member, name](Camera& self, const Numbers& values) {
        const Vector3 axis = vector_of(values, name);
        if (!(std::abs(std::hypot(axis[0], axis[1], axis[2]) - 1.0) < 1e-5))
          throw InputError(std::string(name) + " = " + std::string(py::str(array_of(axis))) +
                           ": must have length 1");
        self.*member = axis;
      });
}

void bind_camera(py::module_& module) {
  py::class_<Camera> camera(module,
                            "Camera",
                            "One calibrated X-ray camera, fixed in the room (mm). Detector "
                            "coordinates are (column, row); "
                            "integers are pixel centres.");
  camera.def(py::init([](const std::string& name,
                         const Numbers& source_point,
                         const Numbers& detector_origin_point,
                         const Numbers& column_direction,
                         const Numbers& row_direction,
                         const Numbers& pixel_spacing_mm,
                         const Numbers& size_px) {
               return sound(Camera{name,
                                   vector_of(source_point, "source_point"),
                                   vector_of(detector_origin_point, "detector_origin_point"),
                                   vector_of(column_direction, "column_direction"),
                                   vector_of(row_direction, "row_direction"),
                                   pair_of(pixel_spacing_mm, "pixel_spacing_mm"),
                                   whole_pair_of(size_px, "size_px")});
             }),
             "name"_a,
             "source_point"_a,
             "detector_origin_point"_a,
             "column_direction"_a,
             "row_direction"_a,
             "pixel_spacing_mm"_a,
             "size_px"_a);
  camera.def_static(
      "from_projection_matrix",
      [](const std::string& name,
         const Numbers& pixels_from_room,
         const Numbers& pixel_spacing_mm,
         const Numbers& size_px,
         const Numbers& isocenter_point) {
        const auto values = converted<double>(pixels_from_room, "pixels_from_room", {3, 4});
        std::array<double, 12> matrix{};
        std::copy_n(values.data(), matrix.size(), matrix.begin());
        return Camera::from_projection_matrix(name,
                                              matrix,
                                              pair_of(pixel_spacing_mm, "pixel_spacing_mm"),
                                              whole_pair_of(size_px, "size_px"),
                                              vector_of(isocenter_point, "isocenter_point"));
      },
      "name"_a,
      "pixels_from_room"_a,
      "pixel_spacing_mm"_a,
      "size_px"_a,
      "isocenter_point"_a = std::array<double, 3>{},
      "The camera of a 3x4 projection matrix (pixels from room mm).");
  camera.def_property(
      "name",
      [](const Camera& self) { return self.name; },
      [](Camera& self, const std::string& name) { set_soundly(self, &Camera::name, name); });
  bind_vector(camera, "source_point", &Camera::source_point);
  bind_vector(camera, "detector_origin_point", &Camera::detector_origin_point);
  bind_axis(camera, "column_direction", &Camera::column_direction);
  bind_axis(camera, "row_direction", &Camera::row_direction);
  camera.def_property(
      "pixel_spacing_mm",
      [](const Camera& self) { return self.pixel_spacing_mm; },
      [](Camera& self, const Numbers& values) {
        set_soundly(self, &Camera::pixel_spacing_mm, pair_of(values, "pixel_spacing_mm"));
      },
      "(column, row)");
  camera.def_property(
      "size_px",
      [](const Camera& self) { return self.size_px; },
      [](Camera& self, const Numbers& values) {
        set_soundly(self, &Camera::size_px, whole_pair_of(values, "size_px"));
      },
      "(columns, rows)");
  camera.def(
      "project",
      [](const Camera& self, const Numbers& room_point) {
        return self.project(vector_of(room_point, "room_point"));
      },
      "room_point"_a,
      "(column, row) of a room point (mm).");
  camera.def("__repr__", [](const Camera& self) {
    return "Camera('" + self.name + "', " + std::to_string(self.size_px[0]) + " x " +
           std::to_string(self.size_px[1]) + ")";
  });
  def_pickle(camera,
             &Camera::name,
             &Camera::source_point,
             &Camera::detector_origin_point,
             &Camera::column_direction,
             &Camera::row_direction,
             &Camera::pixel_spacing_mm,
             &Camera::size_px);
}

void bind_rig(py::module_& module) {
  py::class_<Rig> rig(module, "Rig", "The cameras of one room.");
  rig.def(py::init([](std::vector<Camera> cameras, const Numbers& isocenter_point) {
            return sound(Rig{vector_of(isocenter_point, "isocenter_point"), std::move(cameras)});
          }),
          "cameras"_a,
          "isocenter_point"_a = std::array<double, 3>{});
  rig.def_static(
      "read",
      [](const std::filesystem::path& name_or_path) {
        std::vector<std::string> warnings;
        Rig rig_read = Rig::read(name_or_path.string(), &warnings);
        warn_of(warnings);
        return rig_read;
      },
      "name_or_path"_a,
      "Reads a rig file, or a shipped rig: 'c-arm-12in', 'treatment-room'.");
  bind_vector(rig, "isocenter_point", &Rig::isocenter_point);
  rig.def_property_readonly("cameras", [](const Rig& self) { return self.cameras; });
  rig.def(
      "camera",
      [](const Rig& self, const std::string& name) { return self.camera(name); },
      "name"_a);
  rig.def("to_toml", &Rig::to_toml, "The text of a rig file.");
  def_pickle(rig, &Rig::isocenter_point, &Rig::cameras);
}

void bind_frame(py::module_& module) {
  py::class_<PoseFrame> frame(
      module,
      "PoseFrame",
      "The origin of pose parameters: R0, c and r in x_room = r + t + Rz Ry Rx R0 (x_ct - c).");
  frame.def_static(
      "about",
      [](const Numbers& nominal, const Numbers& center_ct_mm) {
        return PoseFrame::about(pose_of(nominal, "nominal"),
                                vector_of(center_ct_mm, "center_ct_mm"));
      },
      "nominal"_a,
      "center_ct_mm"_a,
      "The frame whose nominal pose is a 4x4 matrix and whose rotations are about a point.");
  frame.def_property_readonly("rotation", [](const PoseFrame& self) {
    return py::array_t<double>({3, 3}, self.rotation.data());
  });
  frame.def_property_readonly("center_ct_mm",
                              [](const PoseFrame& self) { return array_of(self.center_ct_mm); });
  frame.def_property_readonly("center_room_mm",
                              [](const PoseFrame& self) { return array_of(self.center_room_mm); });
  frame.def(
      "pose",
      [](const PoseFrame& self, const Numbers& rotation_deg, const Numbers& translation_mm) {
        return matrix_of(self.pose(vector_of(rotation_deg, "rotation_deg"),
                                   vector_of(translation_mm, "translation_mm")));
      },
      "rotation_deg"_a = std::array<double, 3>{},
      "translation_mm"_a = std::array<double, 3>{},
      "room_from_ct (4x4) of rotations about the room's axes and translations along them.");
  frame.def(
      "parameters",
      [](const PoseFrame& self, const Numbers& pose) {
        return array_of(self.parameters(pose_of(pose, "pose")));
      },
      "pose"_a,
      "rx, ry, rz (degrees), tx, ty, tz (mm) of room_from_ct.");
  def_pickle(frame, &PoseFrame::rotation, &PoseFrame::center_ct_mm, &PoseFrame::center_room_mm);
}

}  // namespace

void bind_geometry(py::module_& module) {
  bind_camera(module);
  bind_rig(module);
  bind_frame(module);
  module.def(
      "read_pose",
      [](const std::filesystem::path& path) { return matrix_of(read_pose(path)); },
      "path"_a,
      "room_from_ct (4x4) from a TOML, JSON, .tfm or text file.");
}

}  // namespace attenuation_fields::python
