// SPDX-License-Identifier: Apache-2.0
#include "study/pose_context.h"

#include <algorithm>
#include <memory>

#include "base/error.h"
#include "pose_files/dicom_registration.h"
#include "pose_files/pose_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;

/// The frame of reference of a DICOM CT, a folder or a file; empty for other formats.
std::string frame_of_reference_of_ct(const fs::path& ct) {
  std::error_code error;
  if (!fs::is_directory(ct, error)) return frame_of_reference_of(read_pose_bytes(ct));
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(ct, error))
    if (entry.is_regular_file(error)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files)
    if (std::string uid = frame_of_reference_of(read_pose_bytes(file)); !uid.empty()) return uid;
  return {};
}

/// Other formats than DICOM have none, and are too large to look into.
bool may_be_dicom(const fs::path& ct) {
  std::error_code error;
  const std::string name = ct.filename().string();
  return fs::is_directory(ct, error) || name.ends_with(".dcm") ||
         name.find('.') == std::string::npos;
}

}  // namespace

PoseContext pose_context(const fs::path& ct,
                         const CtReadOptions& ct_reading,
                         const std::optional<CameraRig>& rig,
                         const std::optional<PoseFrame>& frame) {
  PoseContext context;
  context.frame = frame;
  if (rig.has_value()) context.rig = [rig] { return *rig; };
  if (ct.empty()) return context;
  const auto grid = std::make_shared<std::optional<CtGrid>>();
  context.ct_grid = [ct, ct_reading, grid] {
    if (!grid->has_value()) *grid = read_ct(ct, ct_reading).grid;
    return **grid;
  };
  context.ct_frame_of_reference = [ct] {
    return may_be_dicom(ct) ? frame_of_reference_of_ct(ct) : std::string();
  };
  return context;
}

PoseContext pose_context(const Study& study, const StudyCase& study_case) {
  CameraRig rig{study.rig.isocenter_point, {}};
  for (const StudyView& view : study_case.views)
    rig.cameras.push_back(study.rig.camera(view.camera));
  return pose_context(study_case.ct, study_case.ct_reading, rig, study_case.frame());
}

}  // namespace af
