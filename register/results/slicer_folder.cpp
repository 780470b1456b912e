// SPDX-License-Identifier: Apache-2.0
#include "register/results/slicer_folder.h"

#include <nlohmann/json.hpp>
#include <string>

#include "drr/drr_renderer.h"
#include "files/output_file.h"
#include "study/pose_file.h"
#include "xray/image_file.h"

namespace af::registration {
namespace {

using nlohmann::json;

json array_of(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

json control_point(const std::string& name, const Eigen::Vector3d& point_ct_mm) {
  return {{"id", name},
          {"label", name},
          {"position", array_of(point_ct_mm)},
          {"orientation", {1, 0, 0, 0, 1, 0, 0, 0, 1}},
          {"selected", true},
          {"locked", true},
          {"visibility", true},
          {"positionStatus", "defined"}};
}

std::string markups_text(const json& markup) {
  return json({{"@schema",
                "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
                "Resources/Schema/markups-schema-v1.0.3.json#"},
               {"markups", {markup}}})
             .dump(2) +
         "\n";
}

std::string fiducials_text(const std::vector<Eigen::Vector3d>& points_ct_mm) {
  json points = json::array();
  for (const Eigen::Vector3d& point : points_ct_mm)
    points.push_back(control_point("F-" + std::to_string(points.size() + 1), point));
  return markups_text({{"type", "Fiducial"},
                       {"coordinateSystem", "LPS"},
                       {"coordinateUnits", "mm"},
                       {"locked", true},
                       {"labelFormat", "%N-%d"},
                       {"controlPoints", points}});
}

std::string box_text(const CtBox& box) {
  const Eigen::Vector3d center = (box.low_mm + box.high_mm) / 2;
  return markups_text({{"type", "ROI"},
                       {"coordinateSystem", "LPS"},
                       {"coordinateUnits", "mm"},
                       {"locked", true},
                       {"roiType", "Box"},
                       {"center", array_of(center)},
                       {"orientation", {1, 0, 0, 0, 1, 0, 0, 0, 1}},
                       {"size", array_of(box.high_mm - box.low_mm)},
                       {"insideOut", false},
                       {"controlPoints", {control_point("target box", center)}}});
}

std::string readme_text(const StudyCase& study_case) {
  return "# " + study_case.name + " in 3D Slicer\n\n" + "1. Add the CT: `" +
         study_case.ct.string() + "`\n" +
         "2. Add all files of this folder (drag it onto Slicer's window). Load `ct-to-room.tfm` as "
         "a transform.\n"
         "3. In the Transforms module apply `ct-to-room` to the CT, `fiducials` and `target-box`: "
         "they are then in the room,\n   where the X-rays and DRRs stand on their detectors "
         "(LPS mm, values are attenuation).\n"
         "4. Show an X-ray and its DRR as background and foreground of a slice view and rotate it "
         "to the volume plane.\n";
}

std::string image_name(const RegistrationView& view) {
  return file_name_part(view.view.camera.name) + ".nrrd";
}

}  // namespace

void write_slicer_folder(const RegistrationProblem& problem,
                         const RigidTransform& room_from_ct,
                         const StudyCase& study_case,
                         const std::filesystem::path& folder) {
  make_folder(folder);
  write_text_file(folder / "ct-to-room.tfm", pose_to_itk_transform(room_from_ct));
  if (!study_case.fiducials_ct_mm.empty())
    write_text_file(folder / "fiducials.mrk.json", fiducials_text(study_case.fiducials_ct_mm));
  write_text_file(folder / "target-box.mrk.json", box_text(study_case.target_box_ct));
  for (const RegistrationView& view : problem.views) {
    const CameraGeometry& camera = view.view.camera;
    const ImagePlane plane = {camera.detector_origin_point,
                              camera.column_direction,
                              camera.row_direction,
                              camera.pixel_spacing_mm};
    const std::string name = image_name(view);
    write_image_in_space(view.xray, folder / ("xray-" + name), plane);
    write_image_in_space(render_image(*view.renderer, room_from_ct, View::whole_detector(camera)),
                         folder / ("drr-" + name),
                         plane);
  }
  write_text_file(folder / "README.md", readme_text(study_case));
}

std::vector<std::string> slicer_file_names(const RegistrationProblem& problem) {
  std::vector<std::string> names = {
      "ct-to-room.tfm", "fiducials.mrk.json", "target-box.mrk.json", "README.md"};
  for (const RegistrationView& view : problem.views)
    for (const char* kind : {"xray-", "drr-"}) names.push_back(kind + image_name(view));
  return names;
}

void remove_slicer_files(const RegistrationProblem& problem, const std::filesystem::path& folder) {
  for (const std::string& name : slicer_file_names(problem)) remove_output(folder / name);
  std::error_code not_empty;
  std::filesystem::remove(folder, not_empty);
}

}  // namespace af::registration
