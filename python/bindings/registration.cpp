// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/registration.h"

#include <filesystem>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <variant>

#include "python/bindings/arrays.h"
#include "python/bindings/pickled.h"
#include "python/bindings/texts.h"
#include "python/bindings/without_lock.h"

namespace attenuation_fields::python {
namespace {

using namespace pybind11::literals;
using PythonCase = MadeBy<RegistrationCase>;

void bind_result(py::module_& module) {
  py::class_<ViewAgreement> view(
      module, "ViewAgreement", "Shares of an X-ray's gradients that the DRR at a pose explains.");
  view.def_readonly("camera", &ViewAgreement::camera);
  view.def_readonly("coarse", &ViewAgreement::coarse);
  view.def_readonly("fine", &ViewAgreement::fine);
  def_pickle(view, &ViewAgreement::camera, &ViewAgreement::coarse, &ViewAgreement::fine);
  py::class_<Uncertainty> uncertainty(
      module, "Uncertainty", "What a registration says about its own error.");
  uncertainty.def_property_readonly(
      "covariance",
      [](const Uncertainty& self) {
        py::array_t<double> matrix({6, 6});
        for (py::ssize_t row = 0; row < 6; ++row)
          for (py::ssize_t column = 0; column < 6; ++column)
            matrix.mutable_at(row, column) =
                self.covariance[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
        return matrix;
      },
      "Covariance (6x6) of (rx, ry, rz, tx, ty, tz), in degrees and mm. These are motions after "
      "the end, about the centre of the region of interest and along the room's axes.");
  uncertainty.def_readonly("tre_rms_mm",
                           &Uncertainty::tre_rms_mm,
                           "Expected over the target box. TREs have a calibration of their own; "
                           "the covariance would give larger ones.");
  uncertainty.def_readonly(
      "tre_95_mm", &Uncertainty::tre_95_mm, "The TRE stays below with a probability of 0.95.");
  uncertainty.def_readonly(
      "confidence", &Uncertainty::confidence, "Probability of a TRE below 2.5 mm.");
  def_pickle(uncertainty,
             &Uncertainty::covariance,
             &Uncertainty::tre_rms_mm,
             &Uncertainty::tre_95_mm,
             &Uncertainty::confidence);
  py::class_<Registration> result(module, "Registration", "The result of a registration.");
  result.def_readonly("start_index", &Registration::start_index);
  result.def_property_readonly("start",
                               [](const Registration& self) { return matrix_of(self.start); });
  result.def_property_readonly(
      "pose",
      [](const Registration& self) { return matrix_of(self.pose); },
      "The end, room_from_ct (4x4).");
  result.def_property_readonly(
      "start_parameters", [](const Registration& self) { return array_of(self.start_parameters); });
  result.def_property_readonly(
      "parameters",
      [](const Registration& self) { return array_of(self.parameters); },
      "rx, ry, rz (degrees), tx, ty, tz (mm) of the end, relative to the case's frame.");
  result.def_readonly("verdict", &Registration::verdict, "'found', 'doubtful' or 'not found'");
  result.def_readonly("reason", &Registration::reason);
  result.def_readonly("similarity", &Registration::similarity);
  result.def_readonly("chain", &Registration::chain);
  result.def_readonly("stop_reason", &Registration::stop_reason);
  result.def_readonly("evaluations", &Registration::evaluations);
  result.def_readonly("inadmissible", &Registration::inadmissible);
  result.def_readonly("drr_count", &Registration::drr_count);
  result.def_readonly("views", &Registration::views);
  result.def_readonly("uncertainty", &Registration::uncertainty);
  result.def_readonly("initial_tre_mm", &Registration::initial_tre_mm);
  result.def_readonly("tre_mm", &Registration::tre_mm);
  result.def_readonly("seconds", &Registration::seconds);
  result.def("__repr__", [](const Registration& self) {
    return "Registration(" + self.verdict + ": " + self.reason + ")";
  });
  def_pickle(result,
             &Registration::start_index,
             &Registration::start,
             &Registration::pose,
             &Registration::start_parameters,
             &Registration::parameters,
             &Registration::verdict,
             &Registration::reason,
             &Registration::similarity,
             &Registration::chain,
             &Registration::stop_reason,
             &Registration::evaluations,
             &Registration::inadmissible,
             &Registration::drr_count,
             &Registration::views,
             &Registration::uncertainty,
             &Registration::initial_tre_mm,
             &Registration::tre_mm,
             &Registration::seconds);
}

void bind_pose_mode(py::module_& module) {
  py::class_<PoseMode> mode(module, "PoseMode", "A pose at which DRRs are like the X-rays.");
  mode.def_property_readonly(
      "pose", [](const PoseMode& self) { return matrix_of(self.pose); }, "room_from_ct (4x4)");
  mode.def_readonly(
      "likeness", &PoseMode::likeness, "The mean over views of a correlation, at most 1.");
  def_pickle(mode, &PoseMode::pose, &PoseMode::likeness);
}

std::vector<PoseMode> search(const PythonCase& self,
                             int modes,
                             const std::string& orientations,
                             const std::optional<Numbers>& rotation_deg,
                             const std::optional<Numbers>& translation_mm) {
  SearchOptions options{modes, orientations, {}, {}};
  if (rotation_deg.has_value()) options.rotation_deg = vector_of(*rotation_deg, "rotation_deg");
  if (translation_mm.has_value())
    options.translation_mm = vector_of(*translation_mm, "translation_mm");
  return without_lock([&] { return self.search(options); });
}

/// The pixels themselves, read-only. The array keeps their owner alive.
py::array_t<float> image_of(const CaseView& view, std::span<const float> pixels) {
  using Owner = std::shared_ptr<const void>;
  const py::capsule keeper(new Owner(view.owner),
                           [](void* pointer) { delete static_cast<Owner*>(pointer); });
  py::array_t<float> image({view.camera.size_px[1], view.camera.size_px[0]}, pixels.data(), keeper);
  image.attr("flags").attr("writeable") = false;
  return image;
}

/// A CaseView whose images are arrays.
struct PythonView {
  Camera camera;
  std::array<int, 4> roi_px;
  py::array_t<float> xray;
  py::object mask;
};

std::vector<PythonView> views_of(const PythonCase& owner) {
  std::vector<PythonView> views;
  for (const CaseView& view : owner.views()) {
    py::object mask = py::none();
    if (!view.mask.empty()) mask = image_of(view, view.mask);
    views.push_back({view.camera, view.roi_px, image_of(view, view.xray), std::move(mask)});
  }
  return views;
}

/// Rows and columns of a camera's X-ray. Any for a camera that the case does not have.
std::vector<py::ssize_t> shape_of(const PythonCase& owner, const std::string& camera) {
  for (const CaseView& view : owner.views())
    if (view.camera.name == camera) return {view.camera.size_px[1], view.camera.size_px[0]};
  return {-1, -1};
}

void set_xrays(PythonCase& self, const std::map<std::string, Numbers>& xrays) {
  std::map<std::string, py::array_t<float, py::array::c_style | py::array::forcecast>> arrays;
  std::map<std::string, std::span<const float>> pixels;
  for (const auto& [camera, xray] : xrays) {
    const std::string name = "xray of '" + camera + "'";
    const auto& array =
        arrays.emplace(camera, converted<float>(xray, name.c_str(), shape_of(self, camera)))
            .first->second;
    pixels[camera] = {array.data(), static_cast<std::size_t>(array.size())};
  }
  const std::vector<std::string> warnings = without_lock([&] { return self.set_xrays(pixels); });
  // For pickle; the caller may change the array.
  if (!self.arguments.contains("xrays")) self.arguments["xrays"] = py::dict();
  const py::dict kept = self.arguments["xrays"];
  for (const auto& [camera, array] : arrays) kept[py::str(camera)] = array.attr("copy")();
  warn_of(warnings);
}

/// Where fields are, or fields that are open.
using PythonFields = std::map<std::string, std::variant<std::filesystem::path, MadeBy<Field>>>;

RegistrationCase load(const std::filesystem::path& study,
                      const std::string& case_name,
                      const std::string& preset,
                      const std::string& renderer,
                      const PythonFields& fields,
                      const std::vector<std::string>& chains,
                      const std::optional<std::string>& similarity,
                      const std::optional<std::string>& optimizer,
                      std::optional<int> max_evaluations,
                      const std::optional<std::string>& region,
                      bool correct,
                      bool skip_ct_check,
                      double water_mu_per_mm,
                      int air_below_hu,
                      double step_mm,
                      std::uint64_t seed,
                      int threads,
                      double calibration_error_px,
                      bool no_uncertainty,
                      double tube_kvp,
                      double aluminium_mm,
                      double scatter_to_primary) {
  RegistrationOptions options;
  options.preset = preset;
  options.renderer = renderer;
  for (const auto& [camera, field] : fields) {
    if (const auto* path = std::get_if<std::filesystem::path>(&field))
      options.fields[camera] = *path;
    else
      options.opened_fields.emplace(camera, std::get<MadeBy<Field>>(field));
  }
  options.chains = chains;
  options.similarity = similarity;
  options.optimizer = optimizer;
  options.max_evaluations = max_evaluations;
  options.region = region;
  options.correct = correct;
  options.skip_ct_check = skip_ct_check;
  options.water_mu_per_mm = water_mu_per_mm;
  options.air_below_hu = air_below_hu;
  options.step_mm = step_mm;
  options.seed = seed;
  options.threads = threads;
  options.calibration_error_px = calibration_error_px;
  options.no_uncertainty = no_uncertainty;
  RegistrationCase loaded = without_lock([&] {
    return RegistrationCase::load(
        study, case_name, options, {tube_kvp, aluminium_mm, scatter_to_primary});
  });
  warn_of(loaded.warnings());
  return loaded;
}

void bind_case(py::module_& module) {
  py::class_<PythonView> view(module, "CaseView", "An X-ray of a case.");
  view.def_readonly("camera", &PythonView::camera);
  view.def_property_readonly(
      "roi_px",
      [](const PythonView& self) { return py::tuple(py::cast(self.roi_px)); },
      "Region of interest: column, row, width, height.");
  view.def_readonly("xray",
                    &PythonView::xray,
                    "Whole detector (h, w) in the attenuation domain: bright is attenuated.");
  view.def_readonly("mask", &PythonView::mask, "Non-zero is used (h, w); None: every pixel.");
  def_pickle(view, &PythonView::camera, &PythonView::roi_px, &PythonView::xray, &PythonView::mask);
  py::class_<PythonCase> registration_case(
      module,
      "RegistrationCase",
      "A case of a study with all that its registrations need, as af-register loads it.");
  registration_case.def_static("load",
                               keeping_arguments(&load, {"study",           "case_name",
                                                         "preset",          "renderer",
                                                         "fields",          "chains",
                                                         "similarity",      "optimizer",
                                                         "max_evaluations", "region",
                                                         "correct",         "skip_ct_check",
                                                         "water_mu_per_mm", "air_below_hu",
                                                         "step_mm",         "seed",
                                                         "threads",         "calibration_error_px",
                                                         "no_uncertainty",  "tube_kvp",
                                                         "aluminium_mm",    "scatter_to_primary"}),
                               "study"_a,
                               "case_name"_a = "",
                               py::kw_only(),
                               "preset"_a = "",
                               "renderer"_a = "field",
                               "fields"_a = PythonFields{},
                               "chains"_a = std::vector<std::string>{},
                               "similarity"_a = py::none(),
                               "optimizer"_a = py::none(),
                               "max_evaluations"_a = py::none(),
                               "region"_a = py::none(),
                               "correct"_a = false,
                               "skip_ct_check"_a = false,
                               "water_mu_per_mm"_a = RegistrationOptions{}.water_mu_per_mm,
                               "air_below_hu"_a = RegistrationOptions{}.air_below_hu,
                               "step_mm"_a = RegistrationOptions{}.step_mm,
                               "seed"_a = 1,
                               "threads"_a = 1,
                               "calibration_error_px"_a = 0.0,
                               "no_uncertainty"_a = false,
                               "tube_kvp"_a = Beam{}.tube_kvp,
                               "aluminium_mm"_a = Beam{}.aluminium_mm,
                               "scatter_to_primary"_a = Beam{}.scatter_to_primary,
                               "Loads a case as af-register does, but casts rays only if renderer "
                               "says so. fields: a path or an open Field for each camera. Cases "
                               "share an open Field, which is neither read nor decoded again.");
  def_made_again(registration_case, "registration_case");
  registration_case.def(
      "set_xrays",
      &set_xrays,
      "xrays"_a,
      "Registers other X-rays from now on: arrays (h, w) by camera, in the domain that the study's "
      "xray_domain says. They are checked and prepared as if the study's file had held them, and "
      "registrations have the bits of a case that was loaded with them; fields and CT are not "
      "read again. Start, gold standard and masks stay the study's. One thread at a time. An "
      "InputError leaves the case as it was.");
  registration_case.def(
      "set_xray",
      [](PythonCase& self, const std::string& camera, const Numbers& xray) {
        set_xrays(self, {{camera, xray}});
      },
      "camera"_a,
      "xray"_a,
      "set_xrays() for one camera.");
  registration_case.def_property_readonly("name", &RegistrationCase::name);
  registration_case.def_property_readonly(
      "views",
      &views_of,
      "The X-rays in force, as attenuation, with their cameras and regions of interest.");
  registration_case.def_property_readonly("frame",
                                          [](const PythonCase& self) { return self.frame(); });
  registration_case.def_property_readonly(
      "gold",
      [](const PythonCase& self) -> py::object {
        const std::optional<Pose> gold = self.gold();
        if (!gold.has_value()) return py::none();
        return matrix_of(*gold);
      },
      "The pose against which errors are measured, or None.");
  registration_case.def(
      "landmark_start",
      [](const PythonCase& self) -> py::object {
        const std::optional<Pose> start = without_lock([&] { return self.landmark_start(); });
        if (!start.has_value()) return py::none();
        return matrix_of(*start);
      },
      "The pose that the study's landmarks give, or None without them.");
  registration_case.def(
      "usual_start",
      [](const PythonCase& self) {
        return matrix_of(without_lock([&] { return self.usual_start(); }));
      },
      "Where af-register starts by default: landmark_start(), or else the nominal pose.");
  registration_case.def(
      "tre_mm",
      [](const PythonCase& self, const Numbers& pose) {
        return self.tre_mm(pose_of(pose, "pose"));
      },
      "pose"_a,
      "Target registration error of a 4x4 pose; None without a gold pose.");
  registration_case.def(
      "search",
      &search,
      py::kw_only(),
      "modes"_a = SearchOptions{}.modes,
      "orientations"_a = SearchOptions{}.orientations,
      "rotation_deg"_a = py::none(),
      "translation_mm"_a = py::none(),
      "Poses to register from when nobody knows a start, the likeliest first: those of af-register "
      "--start search. orientations: 'field', 'flips' or 'any'. rotation_deg, translation_mm: "
      "farthest from nominal about and along each axis [the fields' range; 20, 40 without].");
  registration_case.def(
      "run",
      [](const PythonCase& self, const std::optional<Numbers>& start, std::int64_t index) {
        std::optional<Pose> pose;
        if (start.has_value()) pose = pose_of(*start, "start");
        return without_lock(
            [&] { return self.run(pose.has_value() ? *pose : self.usual_start(), index); });
      },
      "start"_a = py::none(),
      "start_index"_a = 0,
      "Registers from a 4x4 start [usual_start()].");
  registration_case.def(
      "run_all",
      [](const PythonCase& self, const Numbers& starts) {
        const std::vector<Pose> poses = poses_of(starts, "starts");
        return without_lock([&] { return self.run_all(poses); });
      },
      "starts"_a,
      "Registers from many starts (n, 4, 4). Unlike run(), it does not look into X-rays that do "
      "not fit.");
  registration_case.def(
      "similarity",
      [](const PythonCase& self, const Numbers& pose) {
        const Pose room_from_ct = pose_of(pose, "pose");
        return without_lock([&] { return self.similarity(room_from_ct); });
      },
      "pose"_a,
      "The similarity by which results are compared, at a 4x4 pose. None where the pose is "
      "inadmissible.");
}

}  // namespace

void bind_registration(py::module_& module) {
  bind_result(module);
  bind_pose_mode(module);
  bind_case(module);
  module.def("preset_names", &preset_names);
}

}  // namespace attenuation_fields::python
