// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "ct/ct_reader.h"
#include "files/output_file.h"
#include "study/rig_file.h"
#include "study/study_file.h"
#include "unit/register/method/registration_cases.h"
#include "xray/image_file.h"

namespace af::test {

/// A CT of small_case() and its two views as files: ct.nii.gz, rig.toml, AP.mha, LAT.mha,
/// study.toml.
inline void write_small_study(const std::filesystem::path& folder,
                              const CtVolume& ct = five_ellipsoids()) {
  const SmallCase small = small_case(ct);
  write_ct(ct, folder / "ct.nii.gz");
  Study study;
  study.path = folder / "study.toml";
  study.rig_name_or_path = "rig.toml";
  StudyCase study_case;
  study_case.name = "ellipsoids";
  study_case.ct = folder / "ct.nii.gz";
  study_case.target_box_ct = {{-20, -20, -20}, {20, 20, 20}};
  study_case.gold_room_from_ct = small.gold_room_from_ct;
  for (const registration::RegistrationView& view : small.problem->views) {
    const CameraGeometry& camera = view.view.camera;
    study.rig.cameras.push_back(camera);
    StudyView study_view;
    study_view.camera = camera.name;
    study_view.xray = folder / (camera.name + ".mha");
    study_view.xray_domain = XrayDomain::Attenuation;
    study_view.roi = view.view.roi;
    write_image(view.xray, study_view.xray, 3.0, 3.0);
    study_case.views.push_back(study_view);
  }
  study.cases.push_back(study_case);
  write_text_file(folder / "rig.toml", rig_to_toml(study.rig));
  write_text_file(study.path, study_to_toml(study, folder));
}

}  // namespace af::test
