// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "attenuation_fields/errors.h"
#include "attenuation_fields/renderer.h"
#include "python/bindings/arrays.h"
#include "python/bindings/pickled.h"
#include "python/bindings/without_lock.h"

namespace attenuation_fields::python {
namespace {

using namespace pybind11::literals;

std::vector<py::ssize_t> shape_of(const Renderer& renderer,
                                  std::initializer_list<py::ssize_t> before) {
  std::vector<py::ssize_t> shape(before);
  shape.push_back(renderer.height());
  shape.push_back(renderer.width());
  return shape;
}

/// A pose that is given as a matrix, or by rotations and translations.
Pose pose_of(const Renderer& renderer,
             const Numbers& rotation,
             const Numbers& translation,
             const std::optional<Numbers>& pose) {
  const Vector3 rotation_deg = vector_of(rotation, "rotation_deg");
  const Vector3 translation_mm = vector_of(translation, "translation_mm");
  if (!pose.has_value()) return renderer.frame().pose(rotation_deg, translation_mm);
  if (rotation_deg != Vector3{} || translation_mm != Vector3{})
    throw InputError(
        "pose = given in several ways: use one of pose and rotation_deg/translation_mm");
  return python::pose_of(*pose, "pose");
}

py::array_t<float> drr(const Renderer& self,
                       const Numbers& rotation_deg,
                       const Numbers& translation_mm,
                       const std::optional<Numbers>& pose,
                       const py::object& out) {
  const Pose room_from_ct = pose_of(self, rotation_deg, translation_mm, pose);
  py::array_t<float> image = output_array(shape_of(self, {}), out, "out");
  const std::span<float> pixels = floats_of(image);
  without_lock([&] { return self.drr(room_from_ct, pixels); });
  return image;
}

py::tuple drr_and_gradient(const Renderer& self,
                           const Numbers& rotation,
                           const Numbers& translation,
                           const py::object& out,
                           const py::object& gradient_out) {
  const Vector3 rotation_deg = vector_of(rotation, "rotation_deg");
  const Vector3 translation_mm = vector_of(translation, "translation_mm");
  py::array_t<float> image = output_array(shape_of(self, {}), out, "out");
  py::array_t<float> gradient = output_array(shape_of(self, {6}), gradient_out, "gradient_out");
  const std::span<float> pixels = floats_of(image);
  const std::span<float> planes = floats_of(gradient);
  require_apart(pixels, planes, "out, gradient_out");
  without_lock([&] { return self.drr_and_gradient(rotation_deg, translation_mm, pixels, planes); });
  return py::make_tuple(image, gradient);
}

py::tuple drr_and_motion_gradient(const Renderer& self,
                                  const Numbers& pose,
                                  const Numbers& pivot_room_mm) {
  const Pose room_from_ct = python::pose_of(pose, "pose");
  const Vector3 pivot = vector_of(pivot_room_mm, "pivot_room_mm");
  py::array_t<float> image(shape_of(self, {}));
  py::array_t<float> gradient(shape_of(self, {6}));
  const std::span<float> pixels = floats_of(image);
  const std::span<float> planes = floats_of(gradient);
  without_lock([&] { return self.drr_and_motion_gradient(room_from_ct, pivot, pixels, planes); });
  return py::make_tuple(image, gradient);
}

std::vector<std::array<double, 6>> rows_of(const Numbers& numbers) {
  const auto parameters = converted<double>(numbers, "parameters", {-1, 6});
  std::vector<std::array<double, 6>> rows(static_cast<std::size_t>(parameters.shape(0)));
  const double* values = parameters.data();
  for (auto& row : rows) {
    std::copy_n(values, row.size(), row.begin());
    values += row.size();
  }
  return rows;
}

py::array_t<float> drrs(const Renderer& self,
                        const std::optional<Numbers>& parameters,
                        const std::optional<Numbers>& poses,
                        const py::object& out) {
  if (parameters.has_value() == poses.has_value())
    throw InputError(
        "poses = given in several ways or not at all: use one of parameters and poses");
  std::vector<Pose> matrices;
  if (poses.has_value()) {
    matrices = poses_of(*poses, "poses");
  } else {
    for (const auto& row : rows_of(*parameters))
      matrices.push_back(self.frame().pose({row[0], row[1], row[2]}, {row[3], row[4], row[5]}));
  }
  py::array_t<float> stack =
      output_array(shape_of(self, {static_cast<py::ssize_t>(matrices.size())}), out, "out");
  const std::span<float> pixels = floats_of(stack);
  without_lock([&] { return self.drrs(matrices, pixels); });
  return stack;
}

py::tuple drrs_and_gradients(const Renderer& self, const Numbers& parameters) {
  const auto rows = rows_of(parameters);
  const auto count = static_cast<py::ssize_t>(rows.size());
  py::array_t<float> stack(shape_of(self, {count}));
  py::array_t<float> gradients(shape_of(self, {count, 6}));
  const std::span<float> pixels = floats_of(stack);
  const std::span<float> planes = floats_of(gradients);
  without_lock([&] { return self.drrs_and_gradients(rows, pixels, planes); });
  return py::make_tuple(stack, gradients);
}

void bind_renderer(py::module_& module) {
  py::class_<Renderer> renderer(
      module,
      "Renderer",
      "Makes DRRs of one CT for one camera: a Field or a RayCaster. Values are line integrals of "
      "the attenuation, float32, and those of af-drr to the bit.");
  renderer.def_property_readonly("camera", [](const Renderer& self) { return self.camera(); });
  renderer.def_property_readonly("frame", [](const Renderer& self) { return self.frame(); });
  renderer.def_property_readonly(
      "shape", [](const Renderer& self) { return py::make_tuple(self.height(), self.width()); });
  renderer.def_property_readonly("threads", &Renderer::threads);
  renderer.def("drr",
               &drr,
               "rotation_deg"_a = Vector3{},
               "translation_mm"_a = Vector3{},
               py::kw_only(),
               "pose"_a = py::none(),
               "out"_a = py::none(),
               "The DRR at a pose: rotations about the room's axes and translations along them "
               "relative to frame, or a 4x4 room_from_ct. `out` receives it if given.");
  renderer.def("drr_and_gradient",
               &drr_and_gradient,
               "rotation_deg"_a = Vector3{},
               "translation_mm"_a = Vector3{},
               py::kw_only(),
               "out"_a = py::none(),
               "gradient_out"_a = py::none(),
               "The DRR and its derivatives (6, h, w) by rx, ry, rz per degree and tx, ty, tz per "
               "mm.");
  renderer.def(
      "drr_and_motion_gradient",
      &drr_and_motion_gradient,
      "pose"_a,
      "pivot_room_mm"_a,
      "The DRR and its derivatives (6, h, w) with respect to small motions after a 4x4 pose: "
      "rotations about the room's axes through a pivot per rad, translations per mm.");
  renderer.def("drrs",
               &drrs,
               "parameters"_a = py::none(),
               py::kw_only(),
               "poses"_a = py::none(),
               "out"_a = py::none(),
               "DRRs (n, h, w) at many poses: parameters (n, 6) as in registrations.csv, or "
               "matrices (n, 4, 4). The renderer's threads share them.");
  renderer.def("drrs_and_gradients",
               &drrs_and_gradients,
               "parameters"_a,
               "DRRs (n, h, w) and their derivatives (n, 6, h, w) at parameters (n, 6).");
}

Outside outside_of(const std::string& name) {
  if (name == "raise") return Outside::Throw;
  if (name == "zero") return Outside::Zero;
  throw InputError("outside = " + name + ": must be raise or zero");
}

Field open_field(const std::filesystem::path& path,
                 const std::string& look_up,
                 const std::optional<Camera>& camera,
                 int threads,
                 const std::string& outside,
                 double tube_kvp,
                 double aluminium_mm,
                 double scatter_to_primary) {
  const FieldOptions options{look_up, camera, threads, outside_of(outside)};
  return without_lock([&] {
    return Field::open(path, options, {tube_kvp, aluminium_mm, scatter_to_primary});
  });
}

void bind_field(py::module_& module) {
  py::class_<MadeBy<Field>, Renderer> field(
      module, "Field", "A precomputed attenuation field of one CT for one camera.");
  field.def_static(
      "open",
      keeping_arguments(&open_field,
                        {"path",
                         "look_up",
                         "camera",
                         "threads",
                         "outside",
                         "tube_kvp",
                         "aluminium_mm",
                         "scatter_to_primary"}),
      "path"_a,
      py::kw_only(),
      "look_up"_a = "",
      "camera"_a = py::none(),
      "threads"_a = 1,
      "outside"_a = "raise",
      "tube_kvp"_a = Beam{}.tube_kvp,
      "aluminium_mm"_a = Beam{}.aluminium_mm,
      "scatter_to_primary"_a = Beam{}.scatter_to_primary,
      "Reads and verifies a file of a field or of an atlas. look_up: a name of `af-drr "
      "--look-up` (default: the "
      "field's own); threads: 0 is every processor; outside: 'raise' or 'zero' where rays miss the "
      "field; tube_kvp: DRRs of a tube's spectrum, with the field of the CT's bone beside it.");
  field.def_property_readonly(
      "members", &Field::members, "How many fields an atlas has; 1 for a field.");
  field.def_property_readonly("look_up", &Field::look_up);
  field.def_property_readonly("max_rotation_deg", &Field::max_rotation_deg);
  field.def_property_readonly("max_translation_mm", &Field::max_translation_mm);
  field.def("is_of",
            &Field::is_of,
            "ct"_a,
            "Whether it was made from this CT: the same voxels at the same places, to 1e-3 mm.");
  field.def_property_readonly("ct_content_sha256", &Field::ct_content_sha256);
  field.def_property_readonly("payload_sha256", &Field::payload_sha256);
  field.def_property_readonly("water_mu_per_mm", &Field::water_mu_per_mm);
  def_made_again(field, "field", &Field::payload_sha256);
  def_copies(field);
}

RayCaster ray_caster_of(const Ct& ct,
                        const Camera& camera,
                        const Numbers& isocenter_point,
                        const std::optional<PoseFrame>& frame,
                        double water_mu_per_mm,
                        int air_below_hu,
                        double step_mm,
                        int threads,
                        double tube_kvp,
                        double aluminium_mm,
                        double scatter_to_primary) {
  const RayCasterOptions options{water_mu_per_mm,
                                 air_below_hu,
                                 step_mm,
                                 frame,
                                 vector_of(isocenter_point, "isocenter_point"),
                                 threads};
  return without_lock([&] {
    return RayCaster(ct, camera, options, {tube_kvp, aluminium_mm, scatter_to_primary});
  });
}

void bind_ray_caster(py::module_& module) {
  py::class_<MadeBy<RayCaster>, Renderer> caster(
      module, "RayCaster", "Casts rays through a CT. No ray is ever outside.");
  caster.def(py::init(keeping_arguments(&ray_caster_of,
                                        {"ct",
                                         "camera",
                                         "isocenter_point",
                                         "frame",
                                         "water_mu_per_mm",
                                         "air_below_hu",
                                         "step_mm",
                                         "threads",
                                         "tube_kvp",
                                         "aluminium_mm",
                                         "scatter_to_primary"})),
             "ct"_a,
             "camera"_a,
             py::kw_only(),
             "isocenter_point"_a = Vector3{},
             "frame"_a = py::none(),
             "water_mu_per_mm"_a = RayCasterOptions{}.water_mu_per_mm,
             "air_below_hu"_a = RayCasterOptions{}.air_below_hu,
             "step_mm"_a = RayCasterOptions{}.step_mm,
             "threads"_a = 1,
             "tube_kvp"_a = Beam{}.tube_kvp,
             "aluminium_mm"_a = Beam{}.aluminium_mm,
             "scatter_to_primary"_a = Beam{}.scatter_to_primary,
             "frame: the origin of pose parameters; without one it is the CT's centre at "
             "isocenter_point.");
  def_made_again(caster, "ray_caster");
  def_copies(caster);
}

}  // namespace

void bind_renderers(py::module_& module) {
  bind_renderer(module);
  bind_field(module);
  bind_ray_caster(module);
}

}  // namespace attenuation_fields::python
